import asyncio
import contextlib
import math
from typing import Any

import pytest

from drivers.axis import AxisSpec
from drivers.cancellation import finish
from drivers.driver import DriverContext
from drivers.errors import (
    DeviceFaultError,
    DeviceLostError,
    DeviceTimeoutError,
    LimitError,
    MotionError,
    MotionStoppedError,
    NotHomedError,
    OptionsError,
)
from drivers.simulated.axis import SimulatedAxis
from drivers.simulated.controller import SimulatedAxisOptions, SimulatedController
from tests.drivers import rigs
from tests.drivers.clocks import VirtualClock


def rig(clock: VirtualClock | None = None, **options: Any) -> SimulatedController:
    return rigs.controller(rigs.world(clock or VirtualClock()), **options)


async def homed(clock: VirtualClock | None = None, **options: Any) -> SimulatedController:
    controller = rig(clock, **options)
    await controller.open()
    for axis in controller.axes.values():
        await axis.home()
    return controller


def make(
    axis_options: dict[str, Any], spec: AxisSpec = rigs.SLIDE, clock: VirtualClock | None = None
) -> SimulatedController:
    world = rigs.world(clock or VirtualClock())
    options = {spec.name: SimulatedAxisOptions.model_validate(axis_options)}
    return SimulatedController.create(
        {spec.name: spec}, SimulatedController.Options(), options, DriverContext(world.clock, world)
    )


async def under_way(axis: SimulatedAxis, clock: VirtualClock) -> None:
    """Wait until the axis moves."""
    while not (await axis.read()).moving:
        await clock.sleep(0.02)


async def test_homing_lands_at_the_home_position() -> None:
    controller = make({"home_position": "-8 cm", "power_up_position": "30 mm"})
    await controller.open()
    axis = controller.axes["slide"]
    assert (await axis.read()).position is None
    await axis.home()
    assert (await axis.read()).position == pytest.approx(-80.0)
    await controller.close()


async def test_the_motion_takes_the_time_that_physics_asks_for() -> None:
    controller = await homed(clock := VirtualClock())
    axis = controller.axes["slide"]
    began = clock.now()
    await axis.move(50.0)
    assert clock.now() - began >= 50 / 50 + 50 / 200  # at 50 mm/s, with 0.25 s up and down
    await controller.close()


async def test_axes_move_at_the_same_time() -> None:
    controller = await homed(clock := VirtualClock())
    slide, pan = controller.axes["slide"], controller.axes["pan"]
    moves = asyncio.gather(slide.move(80.0), pan.move(15.0))
    await under_way(slide, clock)
    assert (await pan.read()).moving
    await moves
    assert ((await slide.read()).position, (await pan.read()).position) == (80.0, 15.0)
    await controller.close()


async def test_the_encoder_counts_and_scatters() -> None:
    world = rigs.world(
        VirtualClock(), slide={"encoder_resolution": "0.5 mm"}, pan={"reading_noise": "0.01 deg"}
    )
    controller = rigs.controller(world)
    await controller.open()
    slide, pan = controller.axes["slide"], controller.axes["pan"]
    await slide.home()
    with pytest.raises(MotionError, match=r"stands at 20 mm and was sent to 20.1 mm"):
        await slide.move(20.1)
    assert (await slide.read()).position == 20.0
    await pan.home()
    readings = [(await pan.read()).require_homed(pan.spec) for _ in range(200)]
    assert math.sqrt(sum(value**2 for value in readings) / 200) == pytest.approx(0.01, rel=0.2)
    await controller.close()


async def test_a_stalled_axis_is_reported_where_it_stands() -> None:
    controller = await homed()
    controller.inject("stall", "slide")
    with pytest.raises(MotionError, match=r"axis 'slide' stands at 20 mm and was sent to 40 mm"):
        await controller.axes["slide"].move(40.0)
    await controller.axes["slide"].move(40.0)
    await controller.close()


async def test_a_stalled_homing_leaves_the_axis_unhomed() -> None:
    controller = make({"power_up_position": "-90 mm", "home_position": "90 mm"})
    await controller.open()
    controller.inject("stall", "slide")
    with pytest.raises(MotionError, match=r"axis 'slide' stands at 0 mm and was sent to 90 mm"):
        await controller.axes["slide"].home()
    assert not (await controller.axes["slide"].read()).homed
    await controller.close()


async def test_a_motion_that_never_ends_times_out_and_is_stopped() -> None:
    controller = await homed()
    controller.inject("hang", "slide")
    with pytest.raises(DeviceTimeoutError, match=r"axis 'slide' still reports motion .* sent to 40 mm"):
        await controller.axes["slide"].move(40.0)
    assert not (await controller.axes["slide"].read()).moving
    await controller.close()


async def test_a_mute_device_is_lost_after_its_time_out_and_comes_back() -> None:
    controller = await homed(clock := VirtualClock(), answer_timeout="500 ms")
    controller.inject("mute")
    began = clock.now()
    with pytest.raises(DeviceLostError, match=r"has not answered for 0.5 s"):
        await controller.axes["slide"].read()
    assert clock.now() - began >= 0.5
    controller.repair()
    assert (await controller.axes["slide"].read()).homed  # only the answers were missing
    await controller.close()


async def test_a_late_device_answers_before_it_is_taken_for_lost() -> None:
    controller = await homed(clock := VirtualClock(), answer_timeout="500 ms")
    controller.inject("late")
    began = clock.now()
    assert (await controller.axes["slide"].read()).homed
    assert 0.4 < clock.now() - began < 0.5
    controller.repair()
    await controller.close()


async def test_an_unplugged_device_has_forgotten_where_it_is() -> None:
    controller = await homed(clock := VirtualClock())
    axis = controller.axes["slide"]
    move = asyncio.create_task(axis.move(80.0))
    await under_way(axis, clock)
    controller.inject("lost")
    with pytest.raises(DeviceLostError, match=r"axis 'slide': .* has gone"):
        await move
    with pytest.raises(DeviceLostError):
        await controller.open()
    controller.repair()
    with pytest.raises(DeviceLostError, match=r"not open"):
        await axis.read()
    await controller.open()
    state = await axis.read()
    assert (state.homed, state.position, state.moving) == (False, None, False)
    with pytest.raises(NotHomedError):
        await axis.move(10.0)
    await axis.home()
    await axis.move(10.0)
    await controller.close()


async def test_an_alarm_stops_the_axes_until_they_are_homed() -> None:
    controller = await homed(clock := VirtualClock())
    slide, pan = controller.axes["slide"], controller.axes["pan"]
    move = asyncio.create_task(slide.move(80.0))
    await under_way(slide, clock)
    controller.inject("alarm")
    with pytest.raises(DeviceFaultError, match=r"axis 'slide': .* in alarm"):
        await move
    state = await slide.read()
    assert (state.moving, state.homed, state.fault) == (False, False, "the controller is in alarm")
    for call in (pan.move(1.0), pan.jog(1.0)):
        with pytest.raises(DeviceFaultError):
            await call
    await slide.home()
    assert (await slide.read()).fault is None
    await slide.move(80.0)
    await controller.close()


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ("stall", MotionError),
        ("hang", DeviceTimeoutError),
        ("lost", DeviceLostError),
        ("mute", DeviceLostError),
        ("alarm", DeviceFaultError),
    ],
)
async def test_a_planned_fault_happens_in_its_motion(fault: str, error: type[Exception]) -> None:
    controller = await homed(faults=[{"fault": fault, "axis": "slide", "motion": 3}])
    slide = controller.axes["slide"]
    await slide.move(20.0)
    with pytest.raises(error):
        await slide.move(60.0)
    controller.repair()
    await controller.close()


async def test_a_homing_that_is_stopped_leaves_the_axis_unhomed() -> None:
    clock = VirtualClock()
    controller = make({"power_up_position": "-90 mm", "home_position": "90 mm"}, clock=clock)
    await controller.open()
    axis = controller.axes["slide"]
    homing = asyncio.create_task(axis.home())
    await under_way(axis, clock)
    await axis.stop()
    with pytest.raises(MotionStoppedError):
        await homing
    assert not (await axis.read()).homed
    await controller.close()


async def test_a_cancelled_move_brakes_and_does_not_jump_to_a_stop() -> None:
    world = rigs.world(VirtualClock())
    controller = rigs.controller(world)
    await controller.open()
    axis, (_, shaft) = controller.axes["slide"], world.shaft("slide")
    await axis.home()
    move = asyncio.create_task(axis.move(80.0))
    await world.clock.sleep(0.8)
    for _ in range(3):  # whoever cancels may be impatient
        move.cancel()
        await asyncio.sleep(0)
    with pytest.raises(asyncio.CancelledError):
        await move
    assert not (await axis.read()).moving
    assert world.clock.now() >= shaft.motion.ends
    assert shaft.motion.ends - shaft.motion.began == pytest.approx(50 / 200, rel=0.01)
    assert shaft.motor(world.clock.now()) < 79.0
    await controller.close()


async def test_jogs_that_are_no_numbers_are_refused() -> None:
    controller = rig()
    await controller.open()
    with pytest.raises(LimitError, match=r"axis 'pan' cannot jog by nan"):
        await controller.axes["pan"].jog(math.nan)
    await controller.close()


def test_options_that_do_not_fit_are_refused_with_the_reason() -> None:
    with pytest.raises(OptionsError, match=r"'slide'.* cannot go to 300 mm"):
        make({"home_position": "300 mm"})
    with pytest.raises(OptionsError, match=r"axis 'slide': .*'3 deg' does not fit an axis that reads mm"):
        make({"power_up_position": "3 deg"})
    with pytest.raises(OptionsError, match=r"names axis 'tilt': this controller drives slide, pan"):
        rig(faults=[{"fault": "stall", "axis": "tilt"}])
    with pytest.raises(OptionsError, match=r"the simulated world has no axis 'tilt'"):
        make({}, AxisSpec("tilt", "revolute", "deg", (0, 1), 1, 1, 1))
    with pytest.raises(OptionsError, match=r"needs a world: add a \[simulation\] table"):
        SimulatedController.create({}, SimulatedController.Options(), {}, DriverContext(VirtualClock()))
    with pytest.raises(ValueError, match=r"'stall' is a fault of one axis"):
        rig().inject("stall")


async def test_finish_hands_on_a_cancellation_only_when_the_work_is_over() -> None:
    done = asyncio.Event()
    log = []

    async def work() -> str:
        await done.wait()
        log.append("done")
        return "result"

    task = asyncio.create_task(finish(work()))
    await asyncio.sleep(0)
    task.cancel()
    await asyncio.sleep(0)
    assert not task.done()
    done.set()
    with contextlib.suppress(asyncio.CancelledError):
        await task
    assert task.cancelled()
    assert log == ["done"]
    assert await finish(work()) == "result"
