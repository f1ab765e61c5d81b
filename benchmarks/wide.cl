/* Forces of short bonds of a plate, 8 nodes a work item, in vectors: the other form of pdsolve/operators/device/plane.cl.

Nothing breaks or softens here. Arguments as in plane.cl; u and f (2, m).
*/

#define JOINED(a, b) a##b
#define WIDE_OF(a) JOINED(a, 8)
#define WIDE_REAL WIDE_OF(REAL)

__kernel void summed(__global const int *start, __global const int *slots, __global const int *ids,
                     __global const REAL *vectors, __global const REAL *stiffness, __global const REAL *u,
                     __global REAL *f, int m) {
  int i = 8 * get_global_id(0), b = i / 64, lane = i % 64;
  WIDE_REAL here_x = vload8(0, u + i), here_y = vload8(0, u + m + i), fx = 0, fy = 0;
  for (int slot = start[b]; slot < start[b + 1]; ++slot) {
    __global const int *row = slots + 8L * slot;
    __global const REAL *v = vectors + 8 * row[4];
    int way = row[lane / 16];
    WIDE_REAL w = vload8(0, stiffness + 64 * row[5] + lane), x, y;
    if (way < FAR) {
      x = vload8(0, u + i + way);
      y = vload8(0, u + m + i + way);
    } else {
      __global const int *j = ids + 16 * (way - FAR) + lane % 16;
      x = (WIDE_REAL)(u[j[0]], u[j[1]], u[j[2]], u[j[3]], u[j[4]], u[j[5]], u[j[6]], u[j[7]]);
      y = (WIDE_REAL)(u[m + j[0]], u[m + j[1]], u[m + j[2]], u[m + j[3]], u[m + j[4]], u[m + j[5]], u[m + j[6]],
                      u[m + j[7]]);
    }
    x -= here_x;
    y -= here_y;
    WIDE_REAL inverse = v[4], along = fma(inverse, x, (WIDE_REAL)v[2]) * x;
    WIDE_REAL e = fma(fma(inverse, y, (WIDE_REAL)v[3]), y, along);
    e = w == 0 ? (WIDE_REAL)0 : e;
    WIDE_REAL pull = w * e;
    pull *= POLYNOMIAL(e);
    fx = fma(pull, (WIDE_REAL)v[0] + x, fx);
    fy = fma(pull, (WIDE_REAL)v[1] + y, fy);
  }
  vstore8(fx, 0, f + i);
  vstore8(fy, 0, f + m + i);
}
