from diagrams.scenario import Scenario as Scenario
from experiments.calls import (
    check_robot as check_robot,
)
from experiments.calls import (
    drive as drive,
)
from experiments.calls import (
    first_command as first_command,
)
from experiments.calls import (
    init as init,
)
from experiments.calls import (
    margins as margins,
)
from experiments.calls import (
    run as run,
)
from experiments.controller_replay import (
    Commands as Commands,
)
from experiments.controller_replay import (
    Replay as Replay,
)
from experiments.export import (
    ExportedController as ExportedController,
)
from experiments.export import (
    export_controller as export_controller,
)
from experiments.hardware.driven_run import FirstCommand as FirstCommand
from experiments.hardware.statics import StaticCheck as StaticCheck
from experiments.new_scenario.new_scenario import NewScenario as NewScenario
from experiments.saved_run import (
    Run as Run,
)
from experiments.saved_run import (
    load as load,
)
from experiments.studies.margins.margins_page import Margins as Margins
