/*
 * Contact law of rough surfaces, E* = 230769.23076923075 MPa.
 * Bodies that yield, without hardening: hardness 2000 MPa.
 * Surface: surface.npy
 * Command: asperity gen law surface.npy --pressure 1:1000:8:log --young 210000.0 --poisson 0.3
 *   --hardness 2000.0 --output law --side 1000 --despike 7.0 --level plane --fill
 * Made: 2026-11-25T23:38:36+00:00, asperity 1.0.0rc1 d905c80d617a
 * How: solved contact by contact, patches without edges: mirror boundary
 * No functions _low and _high. Band: none, one surface was solved.
 * Delta, closure and mean gap in um, nominal pressure in MPa, area in %, force in uN, stiffness
 *   in MPa/um, conductance in W/(mm2 K).
 * Closure is what the interface alone gives way from first touch on:
 *   asperity_law_pressure_at_closure(closure) and its tangent are the law of a contact element.
 * asperity_law_area(delta), asperity_law_delta_at_pressure(pressure) and the like are monotone
 *   cubics; _tangent is their slope. Beyond the ends of the tables, values are constant, those
 *   at the end, and tangents 0: below 0 as at first touch, and up to 14.6628 um and 1000 MPa.
 */
#ifdef ASPERITY_LAW_H
#if ASPERITY_LAW_H != 0x995b7505u
#error "two laws are named asperity_law: give one of the headers another file name"
#endif
#else
#define ASPERITY_LAW_H 0x995b7505u
#include <math.h>

/* Place of the interval that holds an argument between the ends of a table. */
static inline int asperity_law_place(const double *x, int n, double at)
{
    int low = 0, high = n - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle; else high = middle;
    }
    return low;
}

/* Cubic with the values y and the slopes s at x; beyond the ends, the value there. */
static inline double asperity_law_interpolate(const double *x, const double *y, const double *s, int n,
                                      double at)
{
    int i;
    double h, t, u;
    if (!(at > x[0])) return y[0];
    if (at >= x[n - 1]) return y[n - 1];
    i = asperity_law_place(x, n, at);
    if (at == x[i]) return y[i];
    h = x[i + 1] - x[i];
    t = (at - x[i]) / h;
    u = 1.0 - t;
    return y[i] + t * t * (3.0 - 2.0 * t) * (y[i + 1] - y[i])
           + h * t * u * (u * s[i] - t * s[i + 1]);
}

/* Slope of the same cubic: the consistent tangent, continuous; 0 beyond the ends. */
static inline double asperity_law_slope(const double *x, const double *y, const double *s, int n, double at)
{
    int i;
    double h, t, u;
    if (n < 2 || at < x[0] || at > x[n - 1]) return 0.0;
    i = asperity_law_place(x, n, at);
    if (at == x[i]) return s[i];
    h = x[i + 1] - x[i];
    t = (at - x[i]) / h;
    u = 1.0 - t;
    return 6.0 * t * u * (y[i + 1] - y[i]) / h + u * (1.0 - 3.0 * t) * s[i]
           + t * (3.0 * t - 2.0) * s[i + 1];
}

#define ASPERITY_LAW_DELTAS 9
static const double asperity_law_deltas_table[ASPERITY_LAW_DELTAS] = {
    0, 1.1208026160171429, 2.3992173149121898, 4.0243241484887555, 5.8115408755897739,
    7.7584205524505956, 9.6606821502269788, 11.790714713527816, 14.662796334996891,
};
static const double asperity_law_area_table[ASPERITY_LAW_DELTAS] = {
    0, 0.060092542515473829, 0.1442221020371372, 0.36656450934439039, 0.97950844300222339,
    2.6801273961901328, 7.1149570338321011, 18.983234180638181, 50.627967069286704,
};
static const double asperity_law_area_slopes[ASPERITY_LAW_DELTAS] = {
    0.047920057594751042, 0.058957521342563685, 0.08764734942314141, 0.19428058526429642, 0.48949550208348397,
    1.2730928943900175, 3.2620749711304362, 7.2827987365673161, 14.145095765032831,
};
static inline double asperity_law_area(double delta)
{ return asperity_law_interpolate(asperity_law_deltas_table, asperity_law_area_table, asperity_law_area_slopes, ASPERITY_LAW_DELTAS, delta); }
static inline double asperity_law_area_tangent(double delta)
{ return asperity_law_slope(asperity_law_deltas_table, asperity_law_area_table, asperity_law_area_slopes, ASPERITY_LAW_DELTAS, delta); }
static const double asperity_law_force_table[ASPERITY_LAW_DELTAS] = {
    0, 999999.99999999942, 2682695.795279725, 7196856.7300115209, 19306977.288832493,
    51794746.792312101, 138949549.43731374, 372759372.03149378, 999999999.99999952,
};
static const double asperity_law_force_slopes[ASPERITY_LAW_DELTAS] = {
    694136.05600192945, 1059069.0277434713, 1761099.4957362306, 3914306.0929713333, 9580550.5189879555,
    24508132.325273857, 64152369.494064271, 143749566.11231062, 280761453.15671587,
};
static inline double asperity_law_force(double delta)
{ return asperity_law_interpolate(asperity_law_deltas_table, asperity_law_force_table, asperity_law_force_slopes, ASPERITY_LAW_DELTAS, delta); }
static inline double asperity_law_force_tangent(double delta)
{ return asperity_law_slope(asperity_law_deltas_table, asperity_law_force_table, asperity_law_force_slopes, ASPERITY_LAW_DELTAS, delta); }
static const double asperity_law_mean_gap_table[ASPERITY_LAW_DELTAS] = {
    14.599889824125793, 13.479321924663344, 12.201880014132621, 10.579801697039771, 8.8010436725110957,
    6.8775343423050472, 5.0395369563486456, 3.1138708135648194, 1.1187409538531476,
};
static const double asperity_law_mean_gap_slopes[ASPERITY_LAW_DELTAS] = {
    -1.0000482238770372, -0.99952078660640109, -0.99870938288870992, -0.99672241860478505, -0.99167004326735531,
    -0.97694304159663548, -0.93468776819671961, -0.79076805747453971, -0.57443633528698834,
};
static inline double asperity_law_mean_gap(double delta)
{ return asperity_law_interpolate(asperity_law_deltas_table, asperity_law_mean_gap_table, asperity_law_mean_gap_slopes, ASPERITY_LAW_DELTAS, delta); }
static inline double asperity_law_mean_gap_tangent(double delta)
{ return asperity_law_slope(asperity_law_deltas_table, asperity_law_mean_gap_table, asperity_law_mean_gap_slopes, ASPERITY_LAW_DELTAS, delta); }
static const double asperity_law_pressure_table[ASPERITY_LAW_DELTAS] = {
    0, 0.99999999999999956, 2.6826957952797255, 7.1968567300115218, 19.306977288832496,
    51.794746792312104, 138.94954943731375, 372.75937203149385, 999.99999999999966,
};
static const double asperity_law_pressure_slopes[ASPERITY_LAW_DELTAS] = {
    0.6941360560019294, 1.0590690277434718, 1.7610994957362311, 3.9143060929713336, 9.5805505189879554,
    24.508132325273856, 64.152369494064274, 143.74956611231065, 280.76145315671602,
};
static inline double asperity_law_pressure(double delta)
{ return asperity_law_interpolate(asperity_law_deltas_table, asperity_law_pressure_table, asperity_law_pressure_slopes, ASPERITY_LAW_DELTAS, delta); }
static inline double asperity_law_pressure_tangent(double delta)
{ return asperity_law_slope(asperity_law_deltas_table, asperity_law_pressure_table, asperity_law_pressure_slopes, ASPERITY_LAW_DELTAS, delta); }
static const double asperity_law_closure_table[ASPERITY_LAW_DELTAS] = {
    0, 1.1208026160171429, 2.3992173149121898, 4.0243241484887555, 5.8115408755897739,
    7.7584205524505956, 9.6606821502269788, 11.790714713527816, 14.662796334996891,
};
static const double asperity_law_closure_slopes[ASPERITY_LAW_DELTAS] = {
    1, 1, 1, 1, 1,
    1, 1, 1, 1,
};
static inline double asperity_law_closure(double delta)
{ return asperity_law_interpolate(asperity_law_deltas_table, asperity_law_closure_table, asperity_law_closure_slopes, ASPERITY_LAW_DELTAS, delta); }
static inline double asperity_law_closure_tangent(double delta)
{ return asperity_law_slope(asperity_law_deltas_table, asperity_law_closure_table, asperity_law_closure_slopes, ASPERITY_LAW_DELTAS, delta); }
static const double asperity_law_stiffness_table[ASPERITY_LAW_DELTAS] = {
    0, 5.3391087361269562, 7.9171652663791896, 15.328039155726357, 30.507341893656825,
    100.34488648010199, 261.30783508017834, 775.76668609151284, 3810.2747124506623,
};
static const double asperity_law_stiffness_slopes[ASPERITY_LAW_DELTAS] = {
    6.0469383963549275, 2.8590036062119539, 2.7541425723067894, 5.9060599706858357, 13.614849657331673,
    50.462715428555207, 124.20117389604192, 381.33421760070473, 1524.5206385631504,
};
static inline double asperity_law_stiffness(double delta)
{ return asperity_law_interpolate(asperity_law_deltas_table, asperity_law_stiffness_table, asperity_law_stiffness_slopes, ASPERITY_LAW_DELTAS, delta); }
static inline double asperity_law_stiffness_tangent(double delta)
{ return asperity_law_slope(asperity_law_deltas_table, asperity_law_stiffness_table, asperity_law_stiffness_slopes, ASPERITY_LAW_DELTAS, delta); }
#define ASPERITY_LAW_PRESSURES 9
static const double asperity_law_pressures_table[ASPERITY_LAW_PRESSURES] = {
    0, 1, 2.6826957952797255, 7.1968567300115192, 19.306977288832496,
    51.794746792312097, 138.94954943731375, 372.7593720314938, 1000,
};
static const double asperity_law_delta_at_pressure_table[ASPERITY_LAW_PRESSURES] = {
    0, 1.1208026160171429, 2.3992173149121898, 4.0243241484887555, 5.8115408755897739,
    7.7584205524505956, 9.6606821502269788, 11.790714713527816, 14.662796334996891,
};
static const double asperity_law_delta_at_pressure_slopes[ASPERITY_LAW_PRESSURES] = {
    1.2553913378637678, 0.92060441618956723, 0.51660913227018534, 0.2235941844387411, 0.091101508219629243,
    0.03444301574492363, 0.013713251538062252, 0.0064181481472435527, 0.0012781239269835064,
};
static inline double asperity_law_delta_at_pressure(double pressure)
{ return asperity_law_interpolate(asperity_law_pressures_table, asperity_law_delta_at_pressure_table, asperity_law_delta_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static inline double asperity_law_delta_at_pressure_tangent(double pressure)
{ return asperity_law_slope(asperity_law_pressures_table, asperity_law_delta_at_pressure_table, asperity_law_delta_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static const double asperity_law_closure_at_pressure_table[ASPERITY_LAW_PRESSURES] = {
    0, 1.1208026160171429, 2.3992173149121898, 4.0243241484887555, 5.8115408755897739,
    7.7584205524505956, 9.6606821502269788, 11.790714713527816, 14.662796334996891,
};
static const double asperity_law_closure_at_pressure_slopes[ASPERITY_LAW_PRESSURES] = {
    1.2553913378637678, 0.92060441618956723, 0.51660913227018534, 0.2235941844387411, 0.091101508219629243,
    0.03444301574492363, 0.013713251538062252, 0.0064181481472435527, 0.0012781239269835064,
};
static inline double asperity_law_closure_at_pressure(double pressure)
{ return asperity_law_interpolate(asperity_law_pressures_table, asperity_law_closure_at_pressure_table, asperity_law_closure_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static inline double asperity_law_closure_at_pressure_tangent(double pressure)
{ return asperity_law_slope(asperity_law_pressures_table, asperity_law_closure_at_pressure_table, asperity_law_closure_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static const double asperity_law_area_at_pressure_table[ASPERITY_LAW_PRESSURES] = {
    0, 0.060092542515473829, 0.1442221020371372, 0.36656450934439039, 0.97950844300222339,
    2.6801273961901328, 7.1149570338321011, 18.983234180638181, 50.627967069286704,
};
static const double asperity_law_area_at_pressure_slopes[ASPERITY_LAW_PRESSURES] = {
    0.063855790955751668, 0.0550097310853205, 0.049679484473285095, 0.04982173392629393, 0.051334198891222489,
    0.051716671192142426, 0.050831828343740802, 0.050628667140411747, 0.05022511666971647,
};
static inline double asperity_law_area_at_pressure(double pressure)
{ return asperity_law_interpolate(asperity_law_pressures_table, asperity_law_area_at_pressure_table, asperity_law_area_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static inline double asperity_law_area_at_pressure_tangent(double pressure)
{ return asperity_law_slope(asperity_law_pressures_table, asperity_law_area_at_pressure_table, asperity_law_area_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static const double asperity_law_mean_gap_at_pressure_table[ASPERITY_LAW_PRESSURES] = {
    14.599889824125793, 13.479321924663344, 12.201880014132621, 10.579801697039771, 8.8010436725110957,
    6.8775343423050472, 5.0395369563486456, 3.1138708135648194, 1.1187409538531476,
};
static const double asperity_law_mean_gap_at_pressure_slopes[ASPERITY_LAW_PRESSURES] = {
    -1.2552846255634658, -0.9201300347840321, -0.51586940824417127, -0.22276509205410747, -0.090242405991894092,
    -0.033524140890372152, -0.012693141388422846, -0.0049211002909525766, 0,
};
static inline double asperity_law_mean_gap_at_pressure(double pressure)
{ return asperity_law_interpolate(asperity_law_pressures_table, asperity_law_mean_gap_at_pressure_table, asperity_law_mean_gap_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static inline double asperity_law_mean_gap_at_pressure_tangent(double pressure)
{ return asperity_law_slope(asperity_law_pressures_table, asperity_law_mean_gap_at_pressure_table, asperity_law_mean_gap_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static const double asperity_law_stiffness_at_pressure_table[ASPERITY_LAW_PRESSURES] = {
    0, 5.3391087361269562, 7.9171652663791896, 15.328039155726357, 30.507341893656825,
    100.34488648010199, 261.30783508017834, 775.76668609151284, 3810.2747124506623,
};
static const double asperity_law_stiffness_at_pressure_slopes[ASPERITY_LAW_PRESSURES] = {
    6.758207298006309, 2.4983828933707968, 1.5767120739168585, 1.4511739201522571, 1.522470082167626,
    2.0099830895151691, 1.981799439776492, 2.8615681558166566, 6.7592099380385902,
};
static inline double asperity_law_stiffness_at_pressure(double pressure)
{ return asperity_law_interpolate(asperity_law_pressures_table, asperity_law_stiffness_at_pressure_table, asperity_law_stiffness_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
static inline double asperity_law_stiffness_at_pressure_tangent(double pressure)
{ return asperity_law_slope(asperity_law_pressures_table, asperity_law_stiffness_at_pressure_table, asperity_law_stiffness_at_pressure_slopes, ASPERITY_LAW_PRESSURES, pressure); }
#define ASPERITY_LAW_CLOSURES 9
static const double asperity_law_closures_table[ASPERITY_LAW_CLOSURES] = {
    0, 1.1208026160171429, 2.3992173149121898, 4.0243241484887555, 5.8115408755897739,
    7.7584205524505956, 9.6606821502269788, 11.790714713527816, 14.662796334996891,
};
static const double asperity_law_pressure_at_closure_table[ASPERITY_LAW_CLOSURES] = {
    0, 1, 2.6826957952797255, 7.1968567300115192, 19.306977288832496,
    51.794746792312097, 138.94954943731375, 372.7593720314938, 1000,
};
static const double asperity_law_pressure_at_closure_slopes[ASPERITY_LAW_CLOSURES] = {
    0.69413605600193018, 1.059069027743472, 1.7610994957362305, 3.9143060929713327, 9.5805505189879572,
    24.508132325273856, 64.152369494064288, 143.74956611231065, 280.76145315671624,
};
static inline double asperity_law_pressure_at_closure(double closure)
{ return asperity_law_interpolate(asperity_law_closures_table, asperity_law_pressure_at_closure_table, asperity_law_pressure_at_closure_slopes, ASPERITY_LAW_CLOSURES, closure); }
static inline double asperity_law_pressure_at_closure_tangent(double closure)
{ return asperity_law_slope(asperity_law_closures_table, asperity_law_pressure_at_closure_table, asperity_law_pressure_at_closure_slopes, ASPERITY_LAW_CLOSURES, closure); }
#endif
