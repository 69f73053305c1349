"""Examples of plug-ins of karamelo-py: a style of each family, as small as it can be."""
