"""layoutrl: an agent that moves furniture to where a designer would have put it."""

__version__ = "0.1.0"
