"""What the installed executables of the nodes start; each loads ROS when it is called."""

from stickslip_ros.nodes import prepare_process


def plant() -> None:
    """Run the plant node."""
    prepare_process()
    from stickslip_ros.nodes.plant import main

    main()


def washout_controller() -> None:
    """Run the washout controller node."""
    prepare_process()
    from stickslip_ros.nodes.washout_controller import main

    main()


def analyzer() -> None:
    """Run the analyzer node."""
    prepare_process()
    from stickslip_ros.nodes.analyzer import main

    main()


def replay() -> None:
    """Run the replay node."""
    prepare_process()
    from stickslip_ros.nodes.replay import main

    main()
