#include "internal.h"
extern "C" {
int32_t bs_snapshot_size(const bs_world *, int32_t *) { return BS_ERROR_INTERNAL; }
int32_t bs_snapshot_take(const bs_world *, double *, int32_t, char *, int32_t) { return BS_ERROR_INTERNAL; }
int32_t bs_snapshot_restore(bs_world *, const double *, int32_t, char *, int32_t) { return BS_ERROR_INTERNAL; }
}
