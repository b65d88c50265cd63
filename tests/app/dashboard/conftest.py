from tests.nodes.conftest import (  # noqa: F401 - fixtures used here
    _this_machine_only,
    graph,
    often_diagnosed,
)
