/* The DC bus: a capacitor, what the bridge and the board draw from it, and a supply that gives but (by default) does not take. */
#include "plant.h"


/* One period: implicit in the supply's resistance, so that a small R*C does not limit the step. `bridge_as` is the charge that the bridge
 * took; negative while the motor regenerates. */
void plant_supply_step(plant_supply_t *s, double bridge_as, double h_s)
{
    double drawn = bridge_as / h_s + s->load_a;
    double per_farad = h_s / s->capacitance_f;
    double v = (s->bus_v + per_farad * (s->voltage_v / s->resistance_ohm - drawn)) / (1.0 + per_farad / s->resistance_ohm);
    if (v > s->voltage_v && s->sinks == 0.0) {
        v = s->bus_v - per_farad * drawn;
        if (s->bus_v < s->voltage_v) {
            v = plant_max(v, s->voltage_v);
        }
    }
    v = plant_max(v, 0.0);
    s->supply_a = (v - s->bus_v) / per_farad + drawn;
    s->bus_a = bridge_as / h_s;
    s->bus_v = v;
}
