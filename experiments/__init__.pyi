from diagrams.scenario import Scenario as Scenario
from experiments.api import (
    margins as margins,
)
from experiments.api import (
    run as run,
)
from experiments.exported_controller import (
    ExportedController as ExportedController,
)
from experiments.exported_controller import (
    export_controller as export_controller,
)
from experiments.hardware.calls import (
    check_robot as check_robot,
)
from experiments.hardware.calls import (
    drive as drive,
)
from experiments.hardware.calls import (
    first_command as first_command,
)
from experiments.hardware.driven_run import FirstCommand as FirstCommand
from experiments.hardware.statics import StaticCheck as StaticCheck
from experiments.kept_run import (
    Run as Run,
)
from experiments.kept_run import (
    load as load,
)
from experiments.replay import (
    Commands as Commands,
)
from experiments.replay import (
    Replay as Replay,
)
from experiments.studies.margins.page import Margins as Margins
