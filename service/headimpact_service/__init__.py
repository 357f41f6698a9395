"""Headimpact's service: HTTP, storage and files around the science of :mod:`headimpact`."""

from importlib.metadata import version

__version__ = version("headimpact")
