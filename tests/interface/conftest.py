"""One child process reads the logs of all tests of this folder, too."""

from tests.tank.conftest import one_process

__all__ = ["one_process"]
