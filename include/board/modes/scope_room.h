/* The scope's memory: what the chip has left without the fault recorder, less what a mode takes of it. */
#ifndef BOARD_MODES_SCOPE_ROOM_H
#define BOARD_MODES_SCOPE_ROOM_H

#include "drive/drive.h"
#include "drive/modes/params_in_ram.h"

/** Bytes that a mode has in RAM. */
#if defined(TUNING) || defined(PARAMS_IN_RAM)
#define SCOPE_MODE_PARAMS sizeof(drive_params_t)
#else
#define SCOPE_MODE_PARAMS 0u
#endif
#ifdef IDENTIFY
#define SCOPE_MODE_IDENTIFY (sizeof(identify_t) + 128u) /* its stack, too */
#else
#define SCOPE_MODE_IDENTIFY 0u
#endif
#ifdef BRINGUP
#define SCOPE_MODE_BRINGUP 332u
#else
#define SCOPE_MODE_BRINGUP 0u
#endif
#ifdef SNAPSHOT
#define SCOPE_MODE_SNAPSHOT (8u * (DATA_BUFFER_SIZE) + 24u)
#if SCOPE && (DATA_BUFFER_SIZE) > 60
#error userparams.h: SNAPSHOT and SCOPE 1 together have no room for DATA_BUFFER_SIZE rows: lower it to 60
#endif
#else
#define SCOPE_MODE_SNAPSHOT 0u
#endif

/** Of the trace buffer. */
#define SCOPE_BYTES ((848u - SCOPE_MODE_PARAMS - SCOPE_MODE_IDENTIFY - SCOPE_MODE_BRINGUP - SCOPE_MODE_SNAPSHOT) & ~3u)

#endif
