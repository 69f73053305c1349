"""One point of a material under prescribed strains and stresses (commands load_path, element).

The law's own point functions are called from plain Python: nothing is compiled.
"""
