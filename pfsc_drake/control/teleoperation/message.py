"""Layout of the messages that two sides exchange at every tick."""

import numpy as np

# number of the message, from 1 on; signal to follow; measured force; energy sent; energy that the
# tank lacks.
# With three axes the last three components of signal and force are zero.
_SIZES = {"count": 1, "signal": 6, "felt": 6, "energy": 1, "lack": 1}
_ENDS = np.cumsum(list(_SIZES.values())).tolist()
FIELDS = {
    name: slice(end - size, end) for (name, size), end in zip(_SIZES.items(), _ENDS, strict=True)
}
MESSAGE = _ENDS[-1]
UNITS = "1, J^(1/2) s^(1/2) or m and rad, N and Nm, J, J"
