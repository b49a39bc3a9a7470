"""A client as an object: its attributes are the drop-in's functions, bound to the client's id."""

import functools
import inspect
import os
from typing import Any

from sfers_rs import pybullet


class BulletClient:
    """One client with a world of its own, disconnected when the object is collected in the process that made it.

    A copy, and what a pickle is read into, carry the same id: they are the same client.
    """

    def __init__(self, connection_mode: int | None = None, hostName: str | None = None, options: str = "") -> None:
        self._shapes: dict[Any, Any] = {}
        self._pid = os.getpid()
        self._client = -1
        if hostName is not None:
            raise pybullet.error("hostName: this drop-in connects by DIRECT only")
        if connection_mode is None:
            self._client = pybullet.connect(pybullet.SHARED_MEMORY, options=options)
            if self._client >= 0:
                return
            connection_mode = pybullet.DIRECT
        self._client = pybullet.connect(connection_mode, options=options)

    def __del__(self) -> None:
        fields = self.__dict__
        if fields.get("_client", -1) >= 0 and fields.get("_pid") == os.getpid():
            try:
                pybullet.disconnect(physicsClientId=self._client)
                self._client = -1
            except pybullet.error:
                pass

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(pybullet, name)
        if inspect.isbuiltin(attribute):
            attribute = functools.partial(attribute, physicsClientId=self._client)
        if name == "disconnect":
            self._client = -1
        return attribute
