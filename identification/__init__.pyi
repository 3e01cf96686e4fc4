from identification.api import (
    Identification as Identification,
)
from identification.api import (
    consistent_model as consistent_model,
)
from identification.api import (
    estimate as estimate,
)
from identification.api import (
    simulate as simulate,
)
from identification.consistency.writing import WrittenModel as WrittenModel
