"""One render: rounds of samples on a worker thread, polled by the thread that asked for it. No Blender type in here.

The worker calls the native renderer; its progress callback only reads and writes plain values under a lock, so
nothing of Blender is ever touched from a thread that Blender does not know. Rounds are slices that merge exactly: the
image is that of one call, and an artist sees it grow.
"""

import math
import threading
import time
from dataclasses import dataclass, field

# The film's block: 16 consecutive samples are one independent randomisation, slices must be unions of blocks.
BLOCK = 16
# Below this the error is estimated from too few blocks to stop by.
MINIMUM_FOR_NOISE = 4 * BLOCK
# Samples of the sketches: pictures before the first block is there. They cannot be merged with anything (they are no
# whole block) and are thrown away, so they are made only where an artist would wait for longer than this many seconds.
SKETCHES = (1, 4)
PATIENCE = 2.0
# What a fast scene does in a second, for before the first sketch tells the pace.
_PATHS_PER_SECOND = 1e6
# Seconds that a round may take: an artist sees the picture change, and rounds that double would soon take minutes.
LONGEST_ROUND = 20.0


@dataclass(frozen=True)
class Limits:
    """When a render ends; None means that this does not end it. `noise_threshold` is the square root of the relMSE."""

    samples: int | None = 128
    time_limit: float | None = None
    noise_threshold: float | None = None
    seed: int = 0
    threads: int = 0

    def __post_init__(self):
        if self.samples is None and self.time_limit is None and self.noise_threshold is None:
            raise ValueError("Nothing ends this render: set samples, a time limit or a noise threshold.")

    def samples_for_noise(self, samples, error):
        """Samples at which the error should have fallen to the threshold, as it goes with 1/samples; None: unknown."""
        if self.noise_threshold is None or not samples or error is None:
            return None
        return max(MINIMUM_FOR_NOISE, samples * error / self.noise_threshold**2)


@dataclass(frozen=True)
class Round:
    """What to do next: `samples` more (0: the render is over, `stop` says why)."""

    samples: int
    time_left: float | None = None
    stop: str = ""


def next_round(limits, samples, seconds, error):
    """The next round after `samples` in `seconds` with relMSE `error` (None: unknown).

    Rounds double up to LONGEST_ROUND, so that pictures come early and their cost stays a fraction of the render; the
    last is cut to what the noise threshold needs.
    """
    if limits.samples is not None and samples >= limits.samples:
        return Round(0, stop="samples")
    if samples and limits.time_limit is not None and seconds >= limits.time_limit:
        return Round(0, stop="time limit")
    count = max(BLOCK, samples)
    if seconds > 0:
        count = min(count, max(BLOCK, int(LONGEST_ROUND * samples / seconds) // BLOCK * BLOCK))
    needed = limits.samples_for_noise(samples, error)
    if needed is not None:
        if samples >= needed:
            return Round(0, stop="noise threshold")
        count = min(count, math.ceil((needed - samples) / BLOCK) * BLOCK)
    if limits.samples is not None:
        count = min(count, limits.samples - samples)  # only the last round may end inside a block
    time_left = None if limits.time_limit is None else max(limits.time_limit - seconds, 0.001)
    return Round(count, time_left)


def next_sketch(limits, sketches, seconds, paths, patience=PATIENCE):
    """Samples of the sketch that comes after the `sketches` made in `seconds` of `paths` pixels each, 0: none."""
    if len(sketches) == len(SKETCHES) or (limits.samples is not None and limits.samples <= BLOCK):
        return 0
    pace = sum(sketches) * paths / seconds if sketches and seconds > 0 else _PATHS_PER_SECOND
    block = BLOCK * paths / pace
    enough = limits.time_limit is None or 2 * block < limits.time_limit - seconds
    return SKETCHES[len(sketches)] if block > patience and enough else 0


@dataclass
class Progress:
    """A snapshot for the status line: `fraction` is 0 to 1, `error` the square root of the relMSE left, if known."""

    fraction: float = 0.0
    seconds: float = 0.0
    samples: int = 0
    error: float | None = None
    rounds: int = 0

    @property
    def remaining(self):
        """Seconds that are left at the pace so far, None before there is a pace."""
        if self.fraction < 1e-5:
            return None
        return self.seconds * (1.0 - self.fraction) / self.fraction

    def text(self):
        parts = [f"Samples {self.samples}"]
        if self.remaining is not None:
            parts.append(f"Remaining {clock(self.remaining)}")
        if self.error is not None:
            parts.append(f"Error left {100 * self.error:.1f} %")
        return " | ".join(parts)


def clock(seconds):
    minutes, seconds = divmod(int(round(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes:02d}:{seconds:02d}"


@dataclass
class Session:
    """Renders `scene` (a native scene) with `renderer` (the native module) until the limits say so or `cancel()`.

    start(), then poll progress() and latest() from the same thread, then finish(), which gives the result or raises
    what the worker raised. After cancel() the result holds the rounds that were complete, else a sketch, else None.
    """

    renderer: object
    scene: object
    width: int
    height: int
    limits: Limits
    sketches: bool = True  # False where nobody waits for a picture
    patience: float = PATIENCE  # seconds that somebody waits for a block without a sketch
    stop: str = field(default="", init=False)  # what ended it
    history: list = field(default_factory=list, init=False)  # one dict a round: seconds, samples, estimated_error

    def __post_init__(self):
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._cancel = False
        self._failure = None
        self._result = None
        self._progress = Progress()
        self._samples_needed = None  # for the noise threshold, by the newest estimate
        self._began = time.monotonic()
        self._thread = threading.Thread(target=self._work, name="gpis-render", daemon=True)

    def start(self):
        self._began = time.monotonic()
        self._thread.start()

    def wait(self, seconds):
        """Sleep until the render is over, at most `seconds`; True when it is."""
        return self._done.wait(seconds)

    def cancel(self):
        with self._lock:
            self._cancel = True

    def progress(self):
        with self._lock:
            snapshot = Progress(**vars(self._progress))
        snapshot.seconds = time.monotonic() - self._began
        return snapshot

    def latest(self):
        """The result of all rounds that are complete, or None."""
        with self._lock:
            return self._result

    def finish(self):
        self._thread.join()
        if self._failure is not None:
            raise self._failure
        return self._result

    def _work(self):
        try:
            self._rounds()
        except BaseException as failure:  # handed to finish(), which raises it in the caller's thread
            self._failure = failure
        finally:
            self._done.set()

    def _sketch(self):
        """Coarse pictures at once where the first block takes long; False where they were cancelled."""
        made = []
        while True:
            seconds = time.monotonic() - self._began
            count = next_sketch(self.limits, made, seconds, self.width * self.height, self.patience)
            if not count:
                return True
            result = self._render(count, None, 0)
            if result.stats["cancelled"]:
                self.stop = "cancelled"
                return False
            made.append(count)
            self._keep(result, 0, None)

    def _render(self, samples, time_limit, first):
        return self.renderer.render(
            self.scene,
            self.width,
            self.height,
            samples=samples,
            time_limit=time_limit,
            first_sample=first,
            seed=self.limits.seed,
            threads=self.limits.threads,
            progress=self._reporter(first),
        )

    def _rounds(self):
        if self.sketches and not self._sketch():
            return
        whole = None  # of the rounds that are complete
        samples, error = 0, None
        while True:
            seconds = time.monotonic() - self._began
            step = next_round(self.limits, samples, seconds, error)
            if not step.samples:
                self.stop = step.stop
                return
            part = self._render(step.samples, step.time_left, samples)
            cancelled = part.stats["cancelled"]
            if cancelled and whole is None:
                self.stop = "cancelled"  # some pixels have no sample yet: no picture
                return
            whole = part if whole is None else self.renderer.merge([whole, part])
            samples += step.samples
            error = whole.stats["estimated_error"]
            error = error if math.isfinite(error) else None
            self._keep(whole, samples, error)
            if cancelled or part.stats["stopped_by"] == "time":
                self.stop = "cancelled" if cancelled else "time limit"
                return

    def _keep(self, result, samples, error):
        seconds = time.monotonic() - self._began
        with self._lock:
            self._result = result
            self.history.append({"seconds": seconds, "samples": result.stats["samples"], "estimated_error": error})
            self._samples_needed = self.limits.samples_for_noise(samples, error)
            self._progress = Progress(
                max(self._progress.fraction, self._fraction(samples)),
                seconds,
                samples,
                None if error is None else math.sqrt(error),
                len(self.history),
            )

    def _reporter(self, first):
        def report(fraction, stats):
            done = first + stats["samples"]
            with self._lock:
                self._progress.samples = int(done)
                self._progress.fraction = max(self._progress.fraction, self._fraction(done))  # a bar never goes back
                return not self._cancel

        return report

    def _fraction(self, samples):
        """How far the render is, by the limit that will end it first."""
        parts = [0.0]
        if self.limits.samples is not None:
            parts.append(samples / self.limits.samples)
        if self.limits.time_limit is not None:
            parts.append((time.monotonic() - self._began) / self.limits.time_limit)
        if self._samples_needed is not None:
            parts.append(samples / self._samples_needed)
        return min(1.0, max(parts))
