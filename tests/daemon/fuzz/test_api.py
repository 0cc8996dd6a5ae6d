"""Anything is asked of the API, by each role and by nobody: it answers as it describes, and those alone who may ask."""

import json
from collections.abc import Iterator
from typing import Any, cast

import pytest
import requests
import schemathesis
from hypothesis import example, given
from hypothesis import strategies as st
from schemathesis import Case, GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.schemas import APIOperation
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from daemon.access.roles import Role
from daemon.api import create_app
from daemon.api.rules import PREFIX, ROLES, ROLES_AT_ROOT
from daemon.service import Service
from tests.daemon.access.keys import bearer
from tests.daemon.fuzz.effort import effort
from tests.daemon.fuzz.served import Served, served

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
    unsupported_method,
]
NEEDED = {f"{method} {PREFIX}{path}": role for name, role in ROLES.items() for method, path in [name.split()]}
NEEDED |= ROLES_AT_ROOT
NOT_LET_IN = {"key_required", "key_unknown", "role_required"}
PATIENCE = 30
"""Seconds in which an answer begins."""
ENDLESS = ("/events", "/stream.mjpg")
"""What the addresses of streams end with."""

askers = st.sampled_from([*Role, None])


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(tmp_path_factory.mktemp("api"), keys_asked=True) as rig:
        yield rig


def operations() -> list[APIOperation]:
    description = create_app(cast(Service, None)).openapi()  # describing asks nothing of the service
    found = schemathesis.openapi.from_dict(description).get_all_operations()
    return [result.ok() for result in found]


def cases(operation: APIOperation) -> st.SearchStrategy[Case]:
    """Cases that are as described, and cases that are not."""
    right, wrong = (operation.as_strategy(mode) for mode in GenerationMode)
    takes_nothing = not (operation.body or operation.path_parameters or operation.query or operation.headers)
    return right if takes_nothing else right | wrong


def may(asker: Role | None, route: str) -> bool:
    needed = NEEDED[route]
    return needed is None or (asker is not None and asker.includes(needed))


def asked(case: Case, rig: Served, asker: Role | None) -> tuple[int, str | None]:
    """Ask, look whether the answer is as described, and return its status and the code of a problem."""
    if asker is not None:
        case.headers.update(bearer(rig.secrets[asker]))
    call = case.as_transport_kwargs(base_url=rig.address)
    with requests.request(**call, timeout=PATIENCE, stream=True) as answer:
        if answer.status_code == 200 and case.path.endswith(ENDLESS):
            assert answer.headers["content-type"].startswith(
                ("text/event-stream", "multipart/x-mixed-replace")
            )
            next(answer.iter_content(1), b"")  # all that was to be told may have been told
        else:
            case.validate_response(answer, checks=CHECKS)
        is_problem = answer.headers.get("content-type") == "application/problem+json"
        return answer.status_code, json.loads(answer.content)["code"] if is_problem else None


@pytest.mark.parametrize("operation", operations(), ids=lambda operation: operation.label)
def test_nothing_comes_of_what_somebody_may_not_ask(operation: APIOperation, rig: Served) -> None:
    refused = [asker for asker in (None, *Role) if not may(asker, operation.label)]
    if not refused:
        return
    before = rig.state()

    @effort(4)
    @given(case=cases(operation), asker=st.sampled_from(refused))
    def ask(case: Case, asker: Role | None) -> None:
        status, code = asked(case, rig, asker)
        assert status == (401 if asker is None else 403)
        assert code in NOT_LET_IN

    ask()
    assert rig.state() == before


@pytest.mark.parametrize("operation", operations(), ids=lambda operation: operation.label)
def test_every_answer_is_as_described(operation: APIOperation, rig: Served) -> None:
    @effort(8)
    @given(case=cases(operation), asker=askers, holds_lease=st.booleans(), known=st.booleans())
    def ask(case: Case, asker: Role | None, holds_lease: bool, known: bool) -> None:
        lease = rig.service.leases.current
        if holds_lease and lease is not None:
            case.headers["X-Lease"] = lease.token
        if known:
            _name_what_there_is(case, rig)
        _, code = asked(case, rig, asker)
        assert (code in NOT_LET_IN) == (not may(asker, operation.label))

    ask()


@effort(8)
@example(query={"rate": "0"}, asker=Role.VIEWER)
@given(
    query=st.dictionaries(
        st.sampled_from(["camera", "rate", "other"]), st.text() | st.floats().map(str) | st.just("main")
    ),
    asker=askers,
)
def test_so_is_the_pose_stream(rig: Served, query: dict[str, str], asker: Role | None) -> None:
    headers = {} if asker is None else bearer(rig.secrets[asker])
    address = requests.Request("GET", f"{rig.address}{PREFIX}/pose/stream", params=query).prepare().url
    assert address is not None
    refused = None
    try:
        with connect(
            address.replace("http", "ws", 1), additional_headers=headers, open_timeout=PATIENCE
        ) as stream:
            message = json.loads(stream.recv(PATIENCE))
    except InvalidStatus as error:
        refused = error.response
    if refused is None:
        assert asker is not None
        assert message.keys() >= {"dropped", "readings"} or message.keys() >= {"code", "detail"}
    else:
        code = json.loads(refused.body or b"")["code"]
        assert (code in NOT_LET_IN) == (asker is None)
        assert refused.status_code in {401, 403, 422}


def _name_what_there_is(case: Case, rig: Served) -> None:
    there: dict[str, Any] = {
        "name": "pan",
        "run_id": rig.run,
        "calibration_id": rig.service.poses.calibration_id,
    }
    case.path_parameters.update({key: there[key] for key in case.path_parameters if key in there})
