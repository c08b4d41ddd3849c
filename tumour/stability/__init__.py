r"""Loss of symmetry of growing elastic disks and balls: how small departures from the round shape grow, and when nothing holds them.

A body that grows in its rim and dies in its core comes under compression along its edge. Whether it stays round is asked here of the radial
states of `tumour.radial`: the equations (2.22) of Zanca, Ahmed, Won, Browning, Flegg & Ruiz-Baier, linearised about them. m is 2 for a disk
and 3 for a ball, Y and S stand for

    disk:  Y = cos k theta,  S = sin k theta e_theta          ball:  Y = Y_l, a spherical harmonic,  S = -grad Y/k,  k = sqrt(l (l + 1))

with the gradient on the unit sphere, so that in both ``grad Y = -k S``, ``div S = k Y`` and S is as large as Y in the mean square. No
equation knows the order of Y_l: all 2 l + 1 of a degree are alike.

**Departure.** The point at R of the body at rest is at ``(r + eps U Y) e_r + eps V S``, with ``alpha + eps alpha_1 Y`` and so for p and C.
In the frame of e_r and the directions across it, at rest and now, with l_r = r', l_t = r/R, ``J = l_r l_t^(m-1)``, ``a = J/l_r`` and
``b = J/l_t``,

    F = diag(l_r, l_t, ...) + eps H
    H_rr = U',  H_tt = (k V/(m-1) + U)/R  in each direction across  (times Y),      H_tr = V',  H_rt = -(k U + V)/R  (times S)
    delta J = j = a H_rr + (m-1) b H_tt.

In a ball H has, across the radius, also ``-V/(k R)`` times the traceless part of the Hessian of Y on the sphere, whose size in the mean
square is ``H_s = sqrt((l-1)(l+2)/2) V/R``.

**Stress.** With ``T = p + alpha Sigma``, ``g = lambda (J - 1) - T`` and ``P = mu (F - F^-T) + g J F^-T``, and with
``T_1 = p_1 + (alpha Sigma)' alpha_1``,

    p_rr = mu (1 + 1/l_r^2) H_rr + (m-1) g l_t^(m-2) H_tt + a (lambda j - T_1)            p_rt = mu H_rt + t H_tr
    p_tt = mu (1 + 1/l_t^2) H_tt + g l_t^(m-2) H_rr + (m-2) g l_r H_tt + b (lambda j - T_1)      p_tr = mu H_tr + t H_rt
    p_s  = (mu (1 + 1/l_t^2) - g l_r) H_s   in a ball,       t = mu/(l_r l_t) - g l_t^(m-2)
    p_rr' + (k/R) p_rt + (m-1) (p_rr - p_tt)/R = 0                                                                     (2.22a)
    p_tr' - (k/R) p_tt + (p_rt + (m-1) p_tr)/R - sqrt((l-1)(l+2)/2) p_s/R = 0,   the last term in a ball alone

**Fluxes.** With ``G = J F^-1 F^-T``, G_rr = a/l_r and ``delta G_rr = (a/l_r) ((m-1) H_tt/l_t - H_rr/l_r)``,
``delta G_tr = -l_t^(m-2) (H_tr/l_r + H_rt/l_t)``,

    f_r = M (a/l_r) p_1' + M p' (a/l_r) ((m-1) H_tt/l_t - H_rr/l_r) + M'(alpha) alpha_1 (a/l_r) p'
    f_t = -(k/R) M (b/l_t) p_1 - M p' l_t^(m-2) (H_tr/l_r + H_rt/l_t)
    dj/dt = (R^(m-1) f_r)'/R^(m-1) + (k/R) f_t                                                     (2.22c)
    d(J alpha_1 + alpha j)/dt = q j + J (q_alpha alpha_1 + q_C C_1)                                (2.22b)
    (R^(m-1) g_r)'/R^(m-1) + (k/R) g_t = u j + J (u_alpha alpha_1 + u_C C_1)                       (2.22d)

with u the uptake, and g_r, g_t as f with M = 1, M' = 0 and C for p.

**Ends.** At R = R_0 nothing pulls, p_rr = p_tr = 0, and p_1 = C_1 = 0. At R = 0 the fields are regular: U = V = p_1 = C_1 = 0 for k >= 2 or
l >= 2. The shift U = -V = 1 of a disk (k = 1), and U = 1, V = -sqrt(2) of a ball (l = 1), solves everything (H = 0) and is taken out by
holding the centre; 0 is a change of the radial state, V = 0. A quarter disk, which slides on its straight sides, has even k only.

**What is left out.** A ball can also be twisted, ``Z e_r x S``. That changes neither J nor the fluxes nor p_1, alpha_1 and C_1, and is not
changed by them; and it always takes work: a rotation, Z = r at l = 1, takes none, so that with Z = r z twice the energy is
``mu (R^2 z'^2 + (l-1)(l+2) z^2) r^2`` dR, in any state.

**Stiffness.** The second variation of the energy, for dead p and alpha_1 the integral of ``H p(H)`` (summed over the components, H_tt m - 1
times) R^(m-1) dR, over that of ``H H``. *Drained*: fluid has time to flow, p_1 = 0, and cells have none to grow, alpha J stays, so
alpha_1 = -alpha j/J and ``lambda j - T_1 = (lambda + alpha (alpha Sigma)'/J) j``. *Undrained*: fluid has no time either, j = 0. Where the
undrained stiffness is 0, j no longer determines U, V and p_1, and rates have no bound. Neither looks at what growth and flow of the radial
state do meanwhile; the linear evolution does.

Modules: `linear` (coefficients at a point), `state` (radial states), `operators` (the grid), `modes` (evolution), `stiffness`, `watch` (for
runs), `picture`. In a table of results `wave_numbers` are the k of a disk and the degrees l of a ball.
"""

from __future__ import annotations

from tumour.stability.modes import ModeGrowth, modes
from tumour.stability.picture import figure
from tumour.stability.stiffness import CriticalTime, Stiffness, critical_time, stiffness

__all__ = ["CriticalTime", "ModeGrowth", "Stiffness", "critical_time", "figure", "modes", "stiffness"]
