"""The folder with the floor that the published simulator loads."""

import os


def getDataPath() -> str:
    """The folder of plane.urdf."""
    return os.path.abspath(os.path.dirname(__file__))
