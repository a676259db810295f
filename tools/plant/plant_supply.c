/* The DC bus: a capacitor, what the bridge, the board and a brake resistor draw from it, and a supply that gives but (by default) does not take. */
#include "plant.h"


/* One period: implicit in the supply's and the brake's resistance, so that a small R*C does not limit the step. `bridge_as` is the charge that the bridge
 * took; negative while the motor regenerates. */
void plant_supply_step(plant_supply_t *s, double bridge_as, double h_s)
{
    double drawn = bridge_as / h_s + s->load_a;
    double per_farad = h_s / s->capacitance_f;
    double brake_s = s->brake_on && s->brake_ohm > 0.0 ? 1.0 / s->brake_ohm : 0.0;
    double v = (s->bus_v + per_farad * (s->voltage_v / s->resistance_ohm - drawn)) / (1.0 + per_farad / s->resistance_ohm + per_farad * brake_s);
    if (v > s->voltage_v && s->sinks == 0.0) {
        v = (s->bus_v - per_farad * drawn) / (1.0 + per_farad * brake_s);
        if (s->bus_v < s->voltage_v) {
            v = plant_max(v, s->voltage_v);
        }
    }
    v = plant_max(v, 0.0);
    s->brake_a = v * brake_s;
    s->supply_a = (v - s->bus_v) / per_farad + drawn + s->brake_a;
    s->bus_a = bridge_as / h_s;
    s->bus_v = v;
}
