"""Entry point of the command damjoint and of `python -m damjoint`: prepares the process (standard
streams, signals, address space) before the libraries are imported.
"""

import atexit
import os
import resource
import signal
import sys
from types import FrameType

#: Least address space [bytes] (`ulimit -v`); below it the libraries do not load, or wait for ever.
LEAST_ADDRESS_SPACE = 0.9e9
#: Below this [bytes] the libraries run in one thread, as each thread takes address space.
THREADED_ADDRESS_SPACE = 8e9

#: Signals that end a command as Ctrl-C does.
INTERRUPTS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


def open_streams() -> None:
    """Open standard streams that are closed (`2>&-`) on the null device. Otherwise the next file
    that is opened would get their number, and the output that libraries print.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))


#: Number of this process; a fork has another one.
PROCESS = os.getpid()


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, but not during an import: a module that is imported by half raises
    other errors later. There the signal is sent again until the import is over. A fork ends.
    """
    if os.getpid() != PROCESS:
        os._exit(130)
    while frame:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            send_again()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def send_again() -> None:
    """Interrupt again after a millisecond."""
    signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.001)


def unraisable(ignored: "sys.UnraisableHookArgs") -> None:
    """Send an interrupt again that came where Python ignores exceptions, as around a fork."""
    if ignored.exc_type is KeyboardInterrupt:
        send_again()
    else:
        sys.__unraisablehook__(ignored)


def handle_signals() -> None:
    """Let SIGTERM and SIGHUP end a command as Ctrl-C does; ignored signals (nohup) stay so."""
    sys.unraisablehook = unraisable
    for number in INTERRUPTS:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, interrupt)


def enough_address_space() -> bool:
    """Whether the libraries can be loaded; in little address space they get one thread."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return True
    if limit < THREADED_ADDRESS_SPACE:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if limit < LEAST_ADDRESS_SPACE:
        print(
            f"damjoint: out of memory: {limit / 1e9:.3g} GB of address space (ulimit -v); at least "
            f"{LEAST_ADDRESS_SPACE / 1e9:g} GB are needed",
            file=sys.stderr,
        )
    return limit >= LEAST_ADDRESS_SPACE


def leave(code: int) -> None:
    """End the process after what is registered for its exit: Python would free every object, which
    takes a tenth of a short run, and might end by a signal instead. Returns if the output can not
    be written, which Python reports.
    """
    atexit._run_exitfuncs()
    try:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    except (OSError, ValueError):
        return
    os._exit(code)


def main() -> int:
    """Run the command: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    open_streams()
    os.environ["MPLBACKEND"] = "agg"  # pictures are files; another one may not be installed
    try:
        handle_signals()
        if not enough_address_space():
            return 1
        from .cli import main as command

        code = command()
    except KeyboardInterrupt:  # before the command has begun
        print("damjoint: interrupted", file=sys.stderr)
        code = 130
    finally:  # the clean-up at exit is not interrupted
        for number in (*INTERRUPTS, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)
    leave(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
