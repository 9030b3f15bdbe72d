"""The command damjoint, and python -m damjoint: what has to be done before anything is imported."""

import os
import resource
import signal
import sys

#: Address space [bytes] that the libraries need (`ulimit -v`); with less they do not load, or wait
#: for memory without end.
LEAST = 0.9e9
#: With less than this each library gets one thread, as every thread takes address space.
PLENTY = 8e9

#: Signals that end a command as Ctrl-C does.
HEEDED = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


def open_streams() -> None:
    """Give a process that was started without standard streams (`2>&-`) empty ones: else the next
    file that is opened gets their number, and what libraries print.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, closefd=False))


def interrupt(number: int, frame: object) -> None:
    """Raise KeyboardInterrupt, but not within an import: a module half imported raises anything,
    and its next import, too. There the signal comes again when it is over.
    """
    while frame:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            signal.signal(signal.SIGALRM, interrupt)
            signal.setitimer(signal.ITIMER_REAL, 0.02)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def heed_signals() -> None:
    """Let SIGTERM, and a terminal that is closed, end a command as Ctrl-C does; what is ignored
    (nohup) stays so.
    """
    for number in HEEDED:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, interrupt)


def enough_memory() -> bool:
    """Whether the address space lets the libraries load; where it is small they get one thread."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return True
    if limit < PLENTY:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if limit < LEAST:
        given = f"{limit / 1e9:.3g} GB of address space (ulimit -v)"
        print(f"damjoint: memory: {given}, at least {LEAST / 1e9:g} are needed", file=sys.stderr)
    return limit >= LEAST


def main() -> int:
    """Entry point: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    open_streams()
    try:
        heed_signals()
        if not enough_memory():
            return 1
        from .cli import main as command

        code = command()
    except KeyboardInterrupt:  # before the command has begun
        print("damjoint: interrupted", file=sys.stderr)
        code = 130
    finally:  # what is finished is not interrupted
        for number in (*HEEDED, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)
    if code == 130:  # at once: else Python may end by the signal
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
