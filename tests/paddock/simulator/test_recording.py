"""What is read out of a recorded sim-trace, and what is refused."""

import math

import pytest

from paddock.errors import UserFault
from paddock.simulator.replay import read_drives

HEADER = "episode,steps,X,Y,yaw,steer,throttle,tstamp,episode_status"


def trace(*rows, header=HEADER):
    return "\n".join([header, *rows]).encode()


def row(step, *, episode=0, x=None, yaw=0.0, t=None, status="in_progress"):
    x = 0.1 * step if x is None else x
    t = step / 15 if t is None else t
    return f"{episode},{step},{x},0,{yaw},10,1.5,{t},{status}"


def test_a_row_gives_the_cars_base_behind_its_nose():
    (drive,) = read_drives(trace(row(0, yaw=90.0), row(1, yaw=90.0)))
    assert drive[0].pose == pytest.approx((0.0, -0.14, math.pi / 2))
    assert (drive[0].steering_deg, drive[0].speed_mps) == (10.0, 1.5)


def test_columns_may_come_in_any_order_among_others():
    header = "episode_status,tstamp,wall_clock,episode,X,Y,yaw,steer,throttle,obstacle_crash_counter"
    data = trace("in_progress,5,x,0,0,0.1,0,10,1.5,0", "in_progress,5.1,x,0,0.1,0.1,0,10,1.5,1", header=header)
    assert len(read_drives(data)) == 1


def test_a_rows_time_is_the_previous_rows_timestamp():
    (drive,) = read_drives(trace(row(0, t=10.0), row(1, t=10.05), row(2, t=10.13)))
    assert [state.time for state in drive] == pytest.approx([10.0 - 1 / 15, 10.0, 10.05])


def test_every_interruption_ends_a_drive():
    rows = [row(0, status="prepare"), row(1), row(2), row(3, status="off_track"), row(4, status="pause"), row(5)]
    rows += [row(6), row(7, x=50.0), row(8, x=50.1), row(9, x=50.2, t=9.0), row(10, x=50.3, t=9.1)]
    rows += [row(11, episode=1, x=50.4, t=9.2), row(12, episode=1, x=50.5, t=9.3)]
    drives = read_drives(trace(*rows))
    assert [len(drive) for drive in drives] == [3, 2, 3, 2]


def test_headings_are_continuous_over_the_half_turn():
    (drive,) = read_drives(trace(row(0, yaw=170.0), row(1, yaw=179.0), row(2, yaw=-172.0)))
    assert math.degrees(drive[2].pose.yaw) == pytest.approx(188.0)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "trace_columns_missing"),
        (b"\x80\x04\x95\x00", "trace_not_csv"),
        (b"a\0b", "trace_not_csv"),
        (trace('0,1,"0,0,0,0,1,0,in_progress'), "trace_not_csv"),
        (trace(row(0), header=HEADER.replace("yaw", "heading")), "trace_columns_missing"),
        (trace(row(0), row(1, x="fast")), "trace_not_a_number"),
        (trace(row(0), row(1, x="nan")), "trace_not_a_number"),
        (trace(row(0), row(1, yaw="inf")), "trace_not_a_number"),
        (trace(row(0), "0,1,0.1"), "trace_not_a_number"),
        (trace(row(1), row(0)), "trace_out_of_order"),
        (trace(row(0), row(1, x="1e300")), "trace_number_too_large"),
        (trace(row(0).replace("1.5", "-1.7e308"), row(1)), "trace_number_too_large"),
        (trace(row(0, t=1e15), row(1, t=1e15 + 1 / 15)), "trace_number_too_large"),
        (trace(f"{row(0)},0", f"{row(1)},0", header=f"{HEADER},X"), "trace_column_twice"),
    ],
)
def test_anything_but_a_trace_is_refused_with_a_code(data, code):
    with pytest.raises(UserFault) as caught:
        read_drives(data)
    assert caught.value.code == code
    assert "%(" not in str(caught.value)


def test_a_refusal_names_the_line():
    with pytest.raises(UserFault, match=r"Line 3 of the trace: X is fast"):
        read_drives(trace(row(0), row(1, x="fast")))


def test_an_oversized_file_is_not_read():
    from paddock.simulator.replay import MAX_BYTES

    with pytest.raises(UserFault) as caught:
        read_drives(b"x" * (MAX_BYTES + 1))
    assert caught.value.code == "trace_too_large"


def test_a_trace_without_rows_has_no_drive():
    assert read_drives(trace()) == []
