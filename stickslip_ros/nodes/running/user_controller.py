"""Run a user's controller in this process: a node in a thread."""

from contextlib import suppress
from threading import Event, Thread

from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.task import Future

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.spinner import destroy

_END_TIMEOUT = 5.0


class ControllerThread:
    """A node on its own executor, in its own thread.

    The executor is of the usual kind, which runs every kind of callback. A managed (lifecycle)
    node that is not active is configured and activated.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.unreported = False
        """Whether the node has failed and the failure was not reported yet."""
        self._failure: BaseException | None = None
        self._idle = Event()
        self._closing = Future()
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._thread = Thread(target=self._run, name=node.get_name(), daemon=True)

    def start(self) -> None:
        """Activate the node if it is managed, and run it; raises RunError if it refuses."""
        if isinstance(self.node, LifecycleNode):
            for transition, name in (
                (self.node.trigger_configure, "configured"),
                (self.node.trigger_activate, "activated"),
            ):
                with suppress(RuntimeError):  # the node has changed its state by itself
                    result = transition()
                    if result is not TransitionCallbackReturn.SUCCESS:
                        raise RunError(
                            f"the controller {self.node.get_name()} could not be {name}: "
                            f"{result.name.lower()}"
                        )
        self._thread.start()

    def check(self) -> None:
        """Raise RunError if the node has stopped."""
        if self._failure is not None:
            self.unreported = False
            kind = type(self._failure).__name__
            raise RunError(
                f"the controller {self.node.get_name()} raised {kind}: {self._failure}"
            ) from self._failure

    def settle(self) -> None:
        """Wait, for 1 s at most, until the current callback has ended."""
        self._idle.clear()
        if self._failure is None:
            self._executor.create_task(self._idle.set)
            self._idle.wait(timeout=1.0)

    def close(self) -> None:
        """End the thread and destroy the node; raises RunError if a callback does not return."""
        # Not by a shutdown of the executor: the thread would miss it just before it waits.
        self._closing.set_result(None)
        if self._thread.ident is not None:
            self._thread.join(_END_TIMEOUT)
        self._executor.shutdown(timeout_sec=0.0)
        if self._thread.is_alive():
            raise RunError(
                f"the controller {self.node.get_name()} is still in a callback, {_END_TIMEOUT:g} s "
                "after the request to end: its thread continues"
            )
        destroy(self.node)

    def _run(self) -> None:
        try:
            self._executor.spin_until_future_complete(self._closing)
            if not self._closing.done():
                raise RuntimeError("ROS was shut down while the loop was open")
        except BaseException as error:
            if not self._closing.done():
                self.unreported = True
                self._failure = error
        finally:
            self._idle.set()
