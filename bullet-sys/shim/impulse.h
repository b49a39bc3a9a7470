// changes[i] += response[i] * impulse, for two arrays of changes. Products and sums are rounded one by one in every version, so the
// bits are equal; that needs -ffp-contract=off where the processor has fused multiply-add.
#ifndef BULLET_SHIM_IMPULSE_H
#define BULLET_SHIM_IMPULSE_H

#if defined(__SSE2__) && !defined(BULLET_SHIM_PLAIN)
#include <emmintrin.h>
#endif

namespace bs {

// Elements from `first` on.
inline void add_impulse_plain(const double *response, double impulse, double *changes, double *body_changes, int count, int first = 0) {
  for (int i = first; i < count; ++i) {
    const double step = response[i] * impulse;
    changes[i] += step;
    body_changes[i] += step;
  }
}

// Two elements at a time where there is SSE2, unless BULLET_SHIM_PLAIN is defined.
inline void add_impulse(const double *response, double impulse, double *changes, double *body_changes, int count) {
  int i = 0;
#if defined(__SSE2__) && !defined(BULLET_SHIM_PLAIN)
  const __m128d both = _mm_set1_pd(impulse);
  for (; i + 2 <= count; i += 2) {
    const __m128d step = _mm_mul_pd(_mm_loadu_pd(response + i), both);
    _mm_storeu_pd(changes + i, _mm_add_pd(_mm_loadu_pd(changes + i), step));
    _mm_storeu_pd(body_changes + i, _mm_add_pd(_mm_loadu_pd(body_changes + i), step));
  }
#endif
  add_impulse_plain(response, impulse, changes, body_changes, count, i);
}

}  // namespace bs

#endif
