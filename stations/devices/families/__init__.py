"""Adapters, one module per family of controllers: the module's name is the ``adapter`` of a profile."""
