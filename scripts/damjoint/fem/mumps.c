/* Interface to MUMPS, the sparse direct solver (https://mumps-solver.org); called by factor.py.

   python-mumps, the other interface for Python, has no order of elimination of the user's. */
#include <dmumps_c.h>
#include <stdlib.h>

/* MUMPS's numbers: jobs, types, orders of elimination; error of this file */
enum { START = -1, END = -2, ANALYSE = 1, FACTORISE = 2, SOLVE = 3 };
enum { SYMMETRIC = 2, SEQUENTIAL = -987654 };
enum { GIVEN = 1, MINIMUM_FILL = 2 };
enum { TOO_LARGE = 1 };

const char *damjoint_mumps_version(void) { return MUMPS_VERSION; }

static int run(DMUMPS_STRUC_C *mumps, int job) {
  mumps->job = job;
  dmumps_c(mumps);
  return mumps->infog[0];
}

/* Release factors. */
void damjoint_release(DMUMPS_STRUC_C *factors) {
  run(factors, END);
  free(factors);
}

/* Factorise a symmetric matrix of n unknowns, given by the entries (row, column: from 1) of its
   upper triangle. order (n): position of each unknown in the elimination, from 1, or NULL for that
   of MUMPS. keep (kept): unknowns that are not eliminated; their Schur complement (kept, kept) has
   its lower triangle filled by rows. store: whether to store the factors, for damjoint_solve.
   available: memory [MB]; needed: the estimate. error: 0, TOO_LARGE if the estimate exceeds the
   memory, or the (negative) error of MUMPS.
   Returns the factors, which use keep and schur until they are released; NULL after an error. */
DMUMPS_STRUC_C *damjoint_factorise(int n, long long entries, int *row, int *column, double *value,
                                   int *order, int kept, int *keep, double *schur, int store,
                                   double available, double *needed, int *error) {
  DMUMPS_STRUC_C *mumps = calloc(1, sizeof *mumps);
  if (!mumps) {
    *error = -13; /* MUMPS's number of a failed allocation */
    return NULL;
  }
  mumps->par = 1;
  mumps->sym = SYMMETRIC;
  mumps->comm_fortran = SEQUENTIAL;
  *error = run(mumps, START);
  if (*error < 0) {
    free(mumps);
    return NULL;
  }
  mumps->icntl[0] = mumps->icntl[1] = mumps->icntl[2] = -1; /* no messages */
  mumps->icntl[3] = 0;
  mumps->cntl[0] = 0; /* no pivoting: eliminated unknowns are positive definite */
  mumps->icntl[13] = 2; /* hence no memory [percent] for delayed pivots */
  mumps->icntl[30] = !store;
  mumps->n = n;
  mumps->nnz = entries;
  mumps->irn = row;
  mumps->jcn = column;
  mumps->a = value;
  mumps->icntl[6] = order ? GIVEN : MINIMUM_FILL;
  mumps->perm_in = order;
  if (kept) {
    mumps->icntl[18] = 1;
    mumps->size_schur = kept;
    mumps->listvar_schur = keep;
    mumps->schur = schur;
  }
  *error = run(mumps, ANALYSE);
  *needed = mumps->infog[15];
  if (*error >= 0 && *needed > available) *error = TOO_LARGE;
  if (*error == 0) *error = run(mumps, FACTORISE);
  if (*error == 0) return mumps;
  damjoint_release(mumps);
  return NULL;
}

/* Solve for `count` right-hand sides, in place. part 0: with the unknowns of the Schur complement
   zero; 1: only eliminate, reduced (kept, count) becomes the right-hand side of the Schur
   complement; 2: after part 1, substitute back its solution `reduced`.
   Returns 0 or the (negative) error of MUMPS. */
int damjoint_solve(DMUMPS_STRUC_C *factors, int count, double *right, int part, double *reduced) {
  factors->icntl[25] = part;
  factors->nrhs = count;
  factors->lrhs = factors->n;
  factors->rhs = right;
  factors->lredrhs = factors->size_schur;
  factors->redrhs = reduced;
  return run(factors, SOLVE);
}
