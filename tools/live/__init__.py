"""A firmware that runs, seen from outside: the client on its serial line, and a virtual board in real time."""
