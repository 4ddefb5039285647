"""The blocking API: that of `armada.aio`, with the waiting done by the thread that calls."""
