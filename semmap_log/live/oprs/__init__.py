"""OpenPRS: a module that its kernels load, and how it gets to where it is built."""
