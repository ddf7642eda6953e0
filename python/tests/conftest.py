"""What several files of tests use."""

import signal

import pytest


@pytest.fixture
def interruptible():
    """Has interrupts raise `KeyboardInterrupt`: who starts the tests in the background may have them ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
