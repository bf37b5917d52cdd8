"""Alarms: rules, what they have raised, receivers, and what these were sent."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from threading import BoundedSemaphore
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response
from pydantic import Field

from service.alarms.notify import require_address
from service.answers import alarms
from service.api import alarm as api
from service.api.base import IDENTIFIER_PATTERN, LONGEST_IDENTIFIER
from service.changes import change_alarms
from service.errors import BusyError
from service.web import auth
from service.web.context import Context
from service.web.problems import CHANGING, READING, SENDING
from service.web.responses import Paged, answer, json_answer, now, sent, taking, until_ended

router = APIRouter(prefix="/v1/alarms", tags=["alarms"])
webhook_router = APIRouter(prefix="/v1/webhooks", tags=["alarms"])

#: [s] That a test waits for its deliveries. Chosen: a little longer than one attempt may take.
_TEST_SECONDS = 12.0
#: Addresses of receivers that are looked at together, in threads of their own: a name may take half a minute to resolve, and
#: so may Apprise. The threads that other requests need are not held meanwhile. Chosen: nobody adds receivers faster.
_AT_ONCE = 4
_LOOKING, _FREE = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="addresses"), BoundedSemaphore(_AT_ONCE)

AlarmId = Annotated[str, Field(description="The rule's name")]
EventId = Annotated[str, Field(description="The alarm's name")]
WebhookId = Annotated[str, Field(description="The receiver's name")]
OfEventState = Annotated[
    Literal["open", "raised", "acknowledged", "cleared"] | None,
    Query(description="Only alarms in this state; `open`: not cleared; default: all"),
]
OfAlarm = Annotated[
    str | None, Query(max_length=LONGEST_IDENTIFIER, description="Only alarms of this rule; default: all")
]
OfClutch = Annotated[
    str | None, Query(pattern=IDENTIFIER_PATTERN, description="Only alarms of this clutch; default: all")
]


@router.get("", response_model=api.AlarmPage, responses=READING)
async def list_alarms(request: Request, context: auth.OwnReader, part: Paged) -> Response:
    """Rules by name. A key that is bound to clutches gets the rules of these clutches."""
    return await answer(request, alarms.page, context.database, part, only=auth.grant_of(request).clutches)


@router.post(
    "",
    status_code=201,
    **taking(api.AlarmIn, api.AlarmOut, api.EXAMPLE, SENDING, {200: "The rule existed before"}),
)
async def post_alarm(request: Request, context: auth.OwnIngester) -> Response:
    """Create a rule. Clutches that already pass its limit raise an alarm at once."""
    return await _saved(request, context, None)


@router.get("/events", response_model=api.EventPage, responses=READING)
async def list_events(
    request: Request,
    context: auth.OwnReader,
    part: Paged,
    state: OfEventState = None,
    alarm_id: OfAlarm = None,
    clutch_id: OfClutch = None,
) -> Response:
    """Alarms, newest first. A key that is bound to clutches gets those of these clutches."""
    clutches = auth.grant_of(request).clutches
    if clutch_id is not None:
        auth.require_clutch(auth.grant_of(request), clutch_id)
        clutches = frozenset({clutch_id})
    return await answer(request, alarms.events, context.database, part, state=state, alarm_id=alarm_id, only=clutches)


@router.get("/events/{event_id}", response_model=api.EventOut, responses=READING)
async def read_event(request: Request, context: auth.OwnReader, event_id: EventId) -> Response:
    """One alarm."""
    return await answer(request, alarms.event, context.database, event_id, only=auth.grant_of(request).clutches)


@router.post(
    "/events/{event_id}/acknowledge",
    **taking(api.AcknowledgeIn, api.EventOut, {"note": "ordered"}, required=False),
)
async def acknowledge_event(request: Request, context: auth.OwnIngester, event_id: EventId) -> Response:
    """Acknowledge an alarm: somebody has seen it. The body is optional."""
    remark = await sent(request, api.AcknowledgeIn) if await request.body() else api.AcknowledgeIn()
    grant = auth.grant_of(request)
    await run_in_threadpool(alarms.event, context.database, event_id, only=grant.clutches)
    acknowledge = partial(change_alarms.acknowledge, note=remark.note, by=grant.name, at=now())
    return json_answer(await run_in_threadpool(acknowledge, context.database, event_id))


@router.get("/{alarm_id}", response_model=api.AlarmOut, responses=READING)
async def read_alarm(request: Request, context: auth.OwnReader, alarm_id: AlarmId) -> Response:
    """A rule in force."""
    return await answer(request, alarms.look_up, context.database, alarm_id, only=auth.grant_of(request).clutches)


@router.put("/{alarm_id}", **taking(api.AlarmIn, api.AlarmOut, api.EXAMPLE))
async def put_alarm(request: Request, context: auth.OwnAdmin, alarm_id: AlarmId) -> Response:
    """Replace a rule. Alarms that the new rule would not raise are cleared."""
    await run_in_threadpool(alarms.look_up, context.database, alarm_id, only=auth.grant_of(request).clutches)
    return await _saved(request, context, alarm_id)


@router.delete("/{alarm_id}", status_code=204, response_class=Response, responses=READING)
async def delete_alarm(request: Request, context: auth.OwnAdmin, alarm_id: AlarmId) -> Response:
    """Delete a rule. Its alarms are cleared and stay listed."""
    await run_in_threadpool(alarms.look_up, context.database, alarm_id, only=auth.grant_of(request).clutches)
    await run_in_threadpool(change_alarms.remove, context.database, alarm_id)
    return Response(status_code=204)


@router.post("/{alarm_id}/test", response_model=api.TestedOut, responses=CHANGING)
async def test_alarm(request: Request, context: auth.OwnAdmin, alarm_id: AlarmId) -> Response:
    """Send a test to each of the rule's receivers, and report the results, at the latest after 12 s."""
    await run_in_threadpool(alarms.look_up, context.database, alarm_id, only=auth.grant_of(request).clutches)
    names = await run_in_threadpool(change_alarms.test, context.database, alarm_id)
    return await _tested(context, names)


@webhook_router.get("", response_model=api.WebhookPage, responses=READING)
async def list_webhooks(request: Request, context: auth.Reader, part: Paged) -> Response:
    """Receivers; the addresses are shown without secrets."""
    return await answer(request, alarms.receivers_by_name, context.database, part)


@webhook_router.post(
    "",
    status_code=201,
    **taking(api.WebhookIn, api.WebhookOut, {"url": "https://example.org/hook", "secret": "wet-clutch-7000"}, SENDING),
)
async def post_webhook(request: Request, context: auth.Admin) -> Response:
    """Add a receiver. Without a secret, the service makes one and shows it once."""
    receiver = await sent(request, api.WebhookIn)
    private = await run_in_threadpool(
        change_alarms.inside_allowed, context.database, context.settings.private_receivers
    )
    if not _FREE.acquire(blocking=False):
        raise BusyError("the addresses of other receivers are being looked at: try again later")
    looking = _LOOKING.submit(require_address, receiver.url, private=private)
    looking.add_done_callback(lambda _: _FREE.release())
    await asyncio.wrap_future(looking)
    by = auth.grant_of(request).name
    row = await run_in_threadpool(change_alarms.add_receiver, context.database, receiver, by=by, at=now())
    new_secret = None if receiver.secret else row.secret
    return json_answer(alarms.receiver_out(row, secret=new_secret), 201, Location=f"/v1/webhooks/{row.webhook_id}")


@webhook_router.get("/{webhook_id}", response_model=api.WebhookOut, responses=READING)
async def read_webhook(request: Request, context: auth.Reader, webhook_id: WebhookId) -> Response:
    """A receiver; its address is shown without secrets."""
    return await answer(request, alarms.receiver, context.database, webhook_id)


@webhook_router.delete("/{webhook_id}", status_code=204, response_class=Response, responses=READING)
async def delete_webhook(context: auth.Admin, webhook_id: WebhookId) -> Response:
    """Delete a receiver, its secret and its deliveries. Waiting deliveries are not sent."""
    await run_in_threadpool(change_alarms.remove_receiver, context.database, webhook_id)
    return Response(status_code=204)


@webhook_router.get("/{webhook_id}/deliveries", response_model=api.DeliveryPage, responses=READING)
async def list_deliveries(request: Request, context: auth.Reader, webhook_id: WebhookId, part: Paged) -> Response:
    """The deliveries of a receiver, sent or waiting, newest first."""
    return await answer(request, alarms.deliveries, context.database, webhook_id, part)


@webhook_router.post("/{webhook_id}/test", response_model=api.TestedOut, responses=CHANGING)
async def test_webhook(context: auth.Admin, webhook_id: WebhookId) -> Response:
    """Send a test to a receiver, and report the result, at the latest after 12 s."""
    names = await run_in_threadpool(change_alarms.test_receiver, context.database, webhook_id, at=now())
    return await _tested(context, names)


async def _saved(request: Request, context: Context, alarm_id: str | None) -> Response:
    """Store a rule and answer with it: 201 if it is new."""
    rule = await sent(request, api.AlarmIn)
    auth.require_clutch(auth.grant_of(request), rule.clutch_id)
    by, save = auth.grant_of(request).name, change_alarms.save
    row, new = await run_in_threadpool(save, context.database, rule, by=by, at=now(), alarm_id=alarm_id)
    context.outbox.wake()
    return json_answer(alarms.rule_out(row), 201 if new else 200, Location=f"/v1/alarms/{row.alarm_id}")


async def _tested(context: Context, names: list[str]) -> Response:
    """The outcome of test messages, once all are sent or time is up."""
    context.outbox.wake()
    items = await until_ended(
        partial(alarms.delivered, context.database, names),
        lambda rows: all(row.state != "waiting" for row in rows),
        _TEST_SECONDS,
    )
    delivered = sum(row.state == "delivered" for row in items)
    message = f"{delivered} of {len(items)} receivers took the test" if items else "there is no receiver: add a webhook"
    return json_answer(api.TestedOut(deliveries=items, message=message))
