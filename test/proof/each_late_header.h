/* The same with late duties. */
#include "late_header.h"

#include "each_header.h"
