"""The memory of a friction law, followed from sample to sample."""

from stickslip_ros.model.friction.base import FrictionLaw, Numbers


class FrictionObserver:
    """Follows the memory of a friction law, as a sampled controller needs it.

    Parameters
    ----------
    law : FrictionLaw
        Law in SI units; a static one has no memory, but may be used, too.
    memory : sequence of float, optional
        Values of its `states`; by default its initial memory at rest.
    """

    def __init__(self, law: FrictionLaw, memory: Numbers | None = None) -> None:
        self.law = law
        """Law that is followed."""
        self.memory = tuple(law.initial_memory(0.0) if memory is None else memory)
        """Present values of its `states`."""
        self._switches = tuple[float, ...]()
        self._sign = 0.0

    def step(self, relative_speed: float, duration: float) -> float:
        """Follow the memory over a sample at a constant speed; return the coefficient at its end.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.
        duration : float
            Duration, s.

        Returns
        -------
        float
            Coefficient with the sign of the force on the slide, dimensionless.

        Raises
        ------
        InvalidInputError
            If the law has a memory and does not define `memory_after`.
        """
        law, sign = self.law, -1.0 if relative_speed < 0.0 else 1.0
        switches = law.switches_at(relative_speed, sign, self.memory)
        if sign == self._sign:
            switches = law.switches_following(self._switches, relative_speed, sign, self.memory)
        self.memory = tuple(law.memory_after(relative_speed, self.memory, switches, duration))
        switches = law.switches_following(switches, relative_speed, sign, self.memory)
        self._switches, self._sign = tuple(switches), sign
        return float(law.friction(relative_speed, sign, self.memory, switches))
