"""Checks of scenario values."""

from pfsc_drake.checks import LARGEST_ANGLE as LARGEST_ANGLE
from pfsc_drake.checks import require as require
from pfsc_drake.checks import require_between as require_between
from pfsc_drake.checks import require_direction as require_direction
from pfsc_drake.checks import require_length as require_length
from pfsc_drake.checks import require_not_negative as require_not_negative
from pfsc_drake.checks import require_numbers as require_numbers
from pfsc_drake.checks import require_one_of as require_one_of
from pfsc_drake.checks import require_place as require_place
from pfsc_drake.checks import require_positive as require_positive
from pfsc_drake.checks import require_whole_fraction as require_whole_fraction
from pfsc_drake.checks import require_whole_ticks as require_whole_ticks
