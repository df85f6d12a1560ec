"""The house cars: small networks trained in this simulator, and how to train them again (``README.md``).

``python -m training.house_cars`` trains them all. Each car is ``NAME.onnx`` and ``NAME.json``: model_metadata.json with
one more key, ``house_car``: display name, description, origin and lap times. Only :mod:`.learner` imports torch.
"""
