"""The watch of the onset of a running machine."""

import re
from dataclasses import replace

import numpy as np

import stickslip_ros as ss
from benchmarks.onset import tapped
from stickslip_ros.measures.onset_watch import OnsetWatch
from stickslip_ros.model.signals import ramp
from stickslip_ros.samples import NO_SAMPLES, SampleColumns
from stickslip_ros.stamps import NANOSECONDS


def test_a_watch_warns_near_the_onset_however_samples_are_divided() -> None:
    """The feed of feed_drive falls from 58 to 51 mm/s; the onset is at 48.9 mm/s."""
    texts: set[str] = set()
    drive = ss.scenario("feed_drive", expects_control=False).plant.as_drive()
    drive = replace(drive, belt_speed=0.058, belt=ramp(-0.007, 0.0, 14.0))
    position, belt = tapped(drive, 1e-5, 5e-7, 14.5, np.random.default_rng(1))
    count, unknown = len(position), np.full(len(position), np.nan)
    stamp = 1_000_000 * np.arange(count) + NANOSECONDS
    samples = SampleColumns(stamp, position, np.zeros(count), unknown, unknown, belt)
    for block in (100, 777, 9000, count):
        watch = OnsetWatch()
        found = [
            each for k in range(0, count, block) for each in watch.feed(samples[k : k + block])
        ]
        assert len(found) > 8
        assert found == watch.ring_downs
        text, near = watch.status(margin=0.1)
        texts.add(text)
        assert near
        assert not watch.status(margin=0.01)[1]
    (text,) = texts
    assert re.fullmatch(r"decay \S+ 1/s, onset 4\S+ \+- \S+ mm/s, feed 51 mm/s", text)
    plain, _ = watch.status(margin=0.1, length="")
    assert re.fullmatch(r"decay \S+, onset 0\.04\S+ \+- \S+, feed 0\.051", plain)
    again = samples[:5000]
    assert watch.feed(again)  # the clock is set back
    slowly = replace(samples, stamp=100 * stamp, belt_velocity=belt / 100.0)
    watch = OnsetWatch()
    watch.pause = 100.0 * drive.natural_period
    assert watch.feed(slowly)
    assert watch.status(margin=0.1)[1]


def test_a_watch_without_ring_downs_says_nothing() -> None:
    watch = OnsetWatch()
    assert watch.feed(NO_SAMPLES) == []
    assert watch.status(margin=0.1) == ("", False)
