"""The house cars: small networks trained in this very simulator, and how to train them again.

``python -m training.house_cars`` trains them all; ``README.md`` beside this file says how they were made and what they
drive. Each car is two files: ``NAME.onnx`` (the network, by the ONNX contract for racers) and ``NAME.json``, which is a
valid ``model_metadata.json`` with one more key, ``house_car``: display name, description, how it was made and the lap
times it was measured at. Only :mod:`.network` and :mod:`.learner` import torch.
"""
