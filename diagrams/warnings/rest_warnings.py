"""What is said beforehand of a run that ends before leader and tool have come to rest."""

from diagrams.scenario import HandParameters
from diagrams.scenario.teleoperation import TeleoperationParameters


def rest_warnings(
    way: TeleoperationParameters | None, hand: HandParameters | None, duration: float
) -> list[str]:
    """Return where both sides do not come to rest at the same place in time, one sentence each.

    Waves that are under way when a hand lets go come back within a round trip, and less of them
    within the next ones.

    Args:
        way: The teleoperation, if there is one.
        hand: The hand that leads, if it is a simulated one.
        duration: Simulated time [s].
    """
    if way is None or hand is None or hand.release >= duration:
        return []
    left = duration - hand.release - hand.grip_ramp
    trip = 2.0 * (way.channel.delay + way.channel.jitter / 2.0 + 2.0 * way.smoothing)
    if left >= trip:
        return []
    return [
        f"hand.release = {hand.release:g} s; from when the hand has let go, leader and tool take "
        f"round trips of {trip:.2g} s until they rest at the same place, and {left:.2g} s are left"
    ]
