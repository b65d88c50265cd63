import os

from hypothesis import settings

# How long an example takes says more of the machine than of the code. Where nobody looks on,
# the examples are the same every time, so that what fails is the change at hand.
settings.register_profile(
    "stickslip_ros", deadline=None, derandomize=bool(os.environ.get("CI")), print_blob=True
)
settings.load_profile("stickslip_ros")
