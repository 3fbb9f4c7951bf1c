"""stub"""
from wbplan.stack import Stack
class PlacoBackend:
    name = "placo"
    def __init__(self, stack: Stack) -> None:
        raise NotImplementedError
