"""The lists of all parameters, each defined once, for columns, forms, serializers, commands, environments and docs."""
