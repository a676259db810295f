/* The same with deferred duties. */
#include "late_header.h"

#include "each_header.h"
