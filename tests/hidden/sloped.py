"""Runs the recipe of src/crosscheck/reference.py on a floor that rises along +x: `sloped.py REFERENCE SLOPE_RAD`, JSON on standard input.

The recipe knows no slope; here what it asks of PyBullet's gravity is turned.
"""

import math
import runpy
import sys

import pybullet

recipe, slope = sys.argv[1], float(sys.argv[2])
set_gravity = pybullet.setGravity


def turned(x, y, z):
    set_gravity(x * math.cos(slope) + z * math.sin(slope), y, z * math.cos(slope) - x * math.sin(slope))


pybullet.setGravity = turned
runpy.run_path(recipe, run_name="__main__")
