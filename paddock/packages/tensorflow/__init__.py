"""Reads frozen TensorFlow graphs of DeepRacer cars and converts them to ONNX, without TensorFlow."""

# It runs inside the sandboxed admission process only.

from .convert import convert

__all__ = ["convert"]
