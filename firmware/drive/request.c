/* What is wished of the drive: by the application, or by a client of the serial line in its place; the retry wishes again what a fault has ended. */
#include "drive/request.h"

#include "drive/drive.h"

/** Complement of the wish, in which no bit of it goes unseen. */
static uint16_t request_complement(const request_t *request)
{
    return (uint16_t) ~(uint16_t)request->wish_run;
}

uint16_t request_holds(const request_t *request)
{
    return (uint16_t)(request->kept == request_complement(request));
}

/** After a write of the wish. @param held request_holds() before it: what has not held must be found */
static void request_keep(request_t *request, uint16_t held)
{
    if (held) {
        request->kept = request_complement(request);
    }
}

void request_init(request_t *request)
{
    drive_zero(request, sizeof *request);
    request->kept = 0xFFFFu; /* request_keep() without a wish */
}

/** A fault has ended a run (1), or that no longer matters (0). */
static void request_interrupt(request_t *request, int16_t interrupted)
{
    if (RETRY_COUNT != 0) {
        request->interrupted = interrupted;
    }
}

int16_t request_stands(const request_t *request)
{
    return (int16_t)(request->wish_run | request->interrupted);
}

/** What the application asks: a start is a change from 0 to 1, so that the end of a fault is none; a stop is a 0. */
static void request_ask(request_t *request, drive_t *d, const asked_t *asked)
{
    if (asked->clear_fault && d->fault != (uint16_t)FAULT_NONE) {
        d->command.clear_fault = 1;
    }
    if (!asked->run) {
        request->wish_run = 0;
        request_interrupt(request, 0);
    } else if (!request->asked_run && d->fault == (uint16_t)FAULT_NONE) {
        request->wish_run = 1;
    } else { /* it stands */
    }
}

/** Brings a target into the range of speeds, or of currents in TORQUE_MODE. */
static int16_t request_in_range(const drive_params_t *p, int16_t target)
{
    const int16_t size = qm_clamp(qm_abs(target), mode_target_range(p, 0).low, mode_target_range(p, 1).high);
    return (int16_t)((target < 0) ? -size : size);
}

/** Begins what is wished, or ends what is not. */
static void request_command(request_t *request, drive_t *d, const drive_params_t *p, int16_t target)
{
    d->command.target_erpm = target;
    if (!request->wish_run) {
        d->command.run = 0;
    } else if (d->state == (uint16_t)DRIVE_STOPPED) {
        drive_start(d, p, (int16_t)((target >= 0) ? 1 : -1));
    } else if (drive_is_closed(d)) {
        d->command.run = 1; /* a stop under way goes on from the present speed; the drive itself turns to the target's direction */
    } else if ((target ^ d->direction) < 0) {
        d->command.run = 0; /* not caught yet: let go, and start again in the other direction */
    } else {
        /* it starts */
    }
}

void request_tick(request_t *request, drive_t *d, const drive_params_t *p, const asked_t *asked)
{
    const uint16_t held = request_holds(request);
    if (asked->take_command) {
        remote_give_up(asked->remote);
    }
    if (!remote_is_in_command(asked->remote)) {
        request_ask(request, d, asked);
    }
    request->asked_run = asked->run;
    if (d->fault != (uint16_t)FAULT_NONE && request->wish_run) {
        request->wish_run = 0;
        request_interrupt(request, 1);
    }
    remote_tick(asked->remote, request, d, asked->elapsed_ms);
    request_command(request, d, p, request_in_range(p, remote_target(asked->remote, asked->target_erpm)));
    if (mode_background(d, p)) {
        request->wish_run = 0;
    }
    request_keep(request, held);
}

/* ---- the retry ---- */

#define RETRY_MS(seconds) ((uint32_t)(PARAM_F(seconds) * 1000.0F + 0.5F))

void retry_init(retry_t *r)
{
    drive_zero(r, sizeof *r);
    r->left = RETRY_COUNT;
}

uint16_t retry_may_pass(uint16_t fault)
{
#define PASSING_BIT(code, name, passes, decided_by, cause, remedy) | ((uint32_t)(passes) << (code))
    const uint32_t passing = 0ul DRIVE_FAULT_TABLE(PASSING_BIT);
    return (uint16_t)((passing >> fault) & 1u);
}

/** Counts a time. @return 1 when it is over; it then begins anew */
static uint16_t time_is_over(retry_t *r, uint16_t elapsed_ms, uint32_t time_ms)
{
    r->waited_ms += elapsed_ms;
    if (r->waited_ms < time_ms) {
        return 0;
    }
    r->waited_ms = 0;
    return 1;
}

/** A fault stands that has ended a run. */
static void retry_pause(retry_t *r, drive_t *d, uint16_t elapsed_ms)
{
    if (r->first == (uint16_t)FAULT_NONE) {
        r->first = d->fault;
    }
    if (r->fault != d->fault) {
        r->fault = d->fault;
        r->waited_ms = 0;
    }
    r->asked = 0;
    if (r->left != 0u && retry_may_pass(d->fault) && !heat_holds(d) && time_is_over(r, elapsed_ms, RETRY_MS(RETRY_PAUSE_SEC))) {
        r->left--;
        r->asked = 1;
        d->command.clear_fault = 1;
    }
}

void retry_tick(retry_t *r, request_t *request, drive_t *d, uint16_t elapsed_ms)
{
    if (RETRY_COUNT == 0) {
        return;
    }
    if (!request->interrupted) {
        uint16_t calm = (uint16_t)(drive_is_closed(d) && time_is_over(r, elapsed_ms, RETRY_MS(RETRY_FORGET_SEC)));
        if (calm || !request->wish_run) { /* long enough without a fault, or a person has stopped it */
            retry_init(r);
        }
    } else if (d->fault != (uint16_t)FAULT_NONE) {
        retry_pause(r, d, elapsed_ms);
    } else if (!r->asked) {
        request->interrupted = 0; /* somebody else has cleared it */
    } else if (d->state == (uint16_t)DRIVE_STOPPED) {
        uint16_t held = request_holds(request);
        request->interrupted = 0;
        request->wish_run = 1;
        request_keep(request, held);
        r->fault = (uint16_t)FAULT_NONE;
        r->asked = 0;
        r->waited_ms = 0;
    } else { /* it is about to stop */
    }
}

/* ---- What a client on the serial line asks of the drive: nothing where SCOPE is 0 ---- */

#if SCOPE
void remote_give_up(remote_t *r)
{
    r->mode = REMOTE_PANEL;
    r->lease_ms = 0;
    r->is_taken = 0;
    r->has_started = 0;
}

uint16_t remote_is_in_command(const remote_t *r)
{
    return r->is_taken;
}

void remote_init(remote_t *r)
{
    remote_give_up(r);
    r->run = 0;
    r->clear_fault = 0;
}

/** As S2 would in a fault. */
static void remote_clear(request_t *request, drive_t *d)
{
    if (d->fault != (uint16_t)FAULT_NONE) {
        d->command.clear_fault = 1;
        request->interrupted = 0;
    }
}

/** 1 while the client is in command. */
static uint16_t remote_holds(const remote_t *r, uint16_t elapsed_ms)
{
    return (uint16_t)(r->mode != (uint16_t)REMOTE_PANEL && r->mode < (uint16_t)REMOTE_MODE_COUNT && r->lease_ms > elapsed_ms);
}

/** A start is a change from 0 to 1, so that neither a new lease nor the end of a fault is one; a stop is a 0. */
static void remote_wish(remote_t *r, request_t *request, const drive_t *d, uint16_t starts)
{
    if (r->run == 0u) {
        r->has_started = 0;
        request->wish_run = 0;
        request->interrupted = 0;
    } else if (starts && d->fault == (uint16_t)FAULT_NONE) {
        r->has_started = (uint16_t)(r->has_started || !request->wish_run);
        request->wish_run = 1;
    } else { /* as it is */
    }
}

void remote_tick(remote_t *r, request_t *request, drive_t *d, uint16_t elapsed_ms)
{
    uint16_t starts = (uint16_t)(r->run != 0u && !r->seen_run);
    r->seen_run = (uint16_t)(r->run != 0u);
    if (r->lease_ms > REMOTE_LEASE_MOST_MS) {
        r->lease_ms = REMOTE_LEASE_MOST_MS;
    }
    if (remote_holds(r, elapsed_ms)) {
        r->is_taken = 1;
        r->lease_ms = (uint16_t)(r->lease_ms - elapsed_ms);
        if (r->clear_fault) {
            remote_clear(request, d);
        }
        remote_wish(r, request, d, starts);
    } else if (r->is_taken) {
        if (r->has_started) {
            request->wish_run = 0;
        }
        remote_give_up(r);
    } else { /* the panel is in command */
    }
    r->clear_fault = 0;
}

int16_t remote_target(const remote_t *r, int16_t of_panel)
{
    return (r->is_taken && r->mode == (uint16_t)REMOTE_TARGET) ? r->target_erpm : of_panel;
}
#endif
