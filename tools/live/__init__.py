"""A firmware that runs, seen from outside: the client on its serial line, the virtual board in real time, and the page in the browser."""
