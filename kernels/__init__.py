"""Kernels of Step B, compiled by Taichi or its fork Quadrants: ``backend`` alone imports them."""
