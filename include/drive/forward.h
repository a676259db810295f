/* Names of the drive's structures, for headers that only point to them. */
#ifndef DRIVE_FORWARD_H
#define DRIVE_FORWARD_H

typedef struct drive_params drive_params_t; /**< drive/drive.h */
typedef struct drive_run drive_run_t;       /**< drive/drive.h */
typedef struct drive drive_t;               /**< drive/drive.h */
typedef struct request request_t;           /**< drive/request.h */
typedef struct remote remote_t;             /**< drive/request.h */

#endif
