"""Frozen TensorFlow graphs of DeepRacer cars, read and converted to ONNX without TensorFlow.

Runs inside the sandboxed admission process only.
"""

from .convert import convert

__all__ = ["convert"]
