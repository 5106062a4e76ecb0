"""Taichi kernels of Step B; the only directory that imports Taichi."""
