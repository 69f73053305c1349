"""Back end: operations, machine code, arguments and exceptions of kernels."""
