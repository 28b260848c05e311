"""What every suite needs before its first process starts."""

import signal

# Where tests run as a shell's background job, Ctrl-C is ignored, and every process that they
# start would inherit that and not end by it.
signal.signal(signal.SIGINT, signal.default_int_handler)
