/* Every number that was chosen by trial and not by a formula: a row each, with unit, meaning and the command that shows its effect.
 *
 * A row is one line, for tools read it: #define NAME value, then in a comment [unit] meaning | target of make. make sensitivity ONLY=NAME shows
 * what moves with a fifth less and a fifth more, a shift by a step (docs/tuned.md). What a user may want to change is in userparams.h. */
#ifndef CONTROL_TUNED_H
#define CONTROL_TUNED_H

/* clang-format off */

/* ---- Current and voltage ---- */
#define USED_BUS_SHARE 1.25         /* [1] of the nominal bus: what braking lifts beyond it serves nobody | run SCENARIO=stop_from_top */
#define DEAD_KNEE_SHARE 0.25        /* [1] of the current that dead time loses: compensation is linear below; more looks like a resistance that drives | lowspeed */
#define SAMPLE_DELAY_CLOCKS 60      /* [25 ns] from the centre of the low sides' conduction to the sample | lowspeed */
#define DEAD_EACH_TURN 0.0333       /* [turn] a rotor that turns by more in a period needs a compensation for each pulse: 12 degrees | table2 MOTOR=spindle_7pp_24v_10000 */
#define OFFSET_MOST_SHARE 0.125     /* [1] of full scale: 0.2 V at the converter; a larger offset is a fault | run SCENARIO=fault_offset */

/* ---- Estimator ---- */
#define PARAM_EIGHT_TURN 0.12       /* [turn] most that the current turns in the eight samples of the derivative: 43 degrees | robust */
#define PARAM_LDI_LEAST_SHARE 0.75  /* [1] of L di/dt at full current and speed: what its limits keep at least where R's rise needs the format | robust */
#define PARAM_OLD_LONGER 1.5        /* [1] turning the old difference of eight samples forward may lengthen an axis by so much | robust */
#define PARAM_EMF_SHARE 0.98        /* [1] of the back-EMF's format: an axis may be lengthened by the turn to the middle of the period | robust */
#define PARAM_ESDQ_RATIO 5          /* [1] corner of the back-EMF filter at low speed over the electrical frequency | lowspeed */
#define FIELDWEAK_FILTER_LEAST 256  /* [Q16] K of the slowest back-EMF filter | lowspeed */

/* ---- What the running motor teaches ---- */
#define ADAPTATION_RATE 6           /* [1/s] flux and resistance follow; less where a part of the voltage is R i | robust */
#define ADAPTATION_KFI_LESS 0.30    /* [1] 1/Kphi may fall by so much | robust */
#define ADAPTATION_KFI_MORE 0.35    /* [1] and rise by so much | robust */
#define ADAPTATION_RS_LESS 0.4      /* [1] R may fall by so much | robust */
#define PARAM_RS_MOST 0.6           /* [1] and rise by so much: then the winding is too hot | robust */
#define ADAPTATION_EMF_SHARE 0.2    /* [1] of dead time's voltage: the least back-EMF that teaches | lowspeed */

/* ---- Controllers ---- */
#define CURRENT_KEEP_LESS 0.001     /* [1] anti-windup of the current controllers: 1 less their KC | table2 */
#define PARAM_FAST_GAIN 1.8        /* [1] times the speed controller's gain after a large innovation | loadsteps */
#define PARAM_CALM_SHARE 0.4        /* [1] most of SPEED_BANDWIDTH_HZ over the electrical frequency, or the speed hunts without load; over 2.7 in a message | lowspeed */
#define PARAM_LOWEST_SHARE 0.65     /* [1] back-EMF over dead-time voltage at the lowest speed at which a rotor is held; times 1732 in a message | lowspeed */
#define RAMP_HOLD_SHARE 0.125       /* [1] of the nominal speed: the ramp waits for a motor that is further behind | run SCENARIO=rated */
#define SPEED_TRIM_SHIFT 8          /* [shift] the trim takes 1/256 of the error in half of its steps, 16 periods apart: 2.4 rad/s at 20 kHz | lowspeed */
#define SPEED_TRIM_LEAK_SHIFT 7     /* [shift] and is forgotten in a tenth of a second | loadsteps */
#define SPEED_TRIM_MOST_SHIFT 3     /* [shift] an eighth of the largest current at most | lowspeed */
#define SPEED_TRIM_ERROR_SHIFT 3    /* [shift] an error beyond an eighth of the speed is no rest | loadsteps */
#define SPEED_SWING_SHIFT 4         /* [shift] one beyond a sixteenth is a swing | pulse */
#define SPEED_SWING_STEPS 152u      /* [steps] of 16 periods, 0.12 s at 20 kHz, that a swing to either side is remembered: a multiple of the following | pulse */
#define SPEED_SWING_MASK 7u         /* [steps] less one: only so often is the error looked at, for a rotor that was nearly lost swings faster | loadsteps */

/* ---- Field weakening and d current ---- */
#define FIELDWEAK_TRIM_STEP 4       /* [Q13 A] d current that the voltage feedback gives back every 16 periods | run SCENARIO=demo */
#define FIELDWEAK_TRIM_MOST 24      /* [Q13 A] and takes at most | run SCENARIO=demo */
#define FIELDWEAK_TRIM_DEFERRED 15      /* [Q13 A] the same with deferred duties | run SCENARIO=demo_40khz */
#define FIELDWEAK_TRIM_FROM 0.6     /* [1] of FW_START_SPEED_RPM: below the voltage feedback takes nothing | run SCENARIO=demo */
#define FIELDWEAK_TRIM_SHIFT 3      /* [shift] counts of d current a step per 8 counts of missing voltage | run SCENARIO=demo */
#define LIMITS_MISSING_Q14 4        /* [Q14/Q13] voltage counts that a count of missing q current asks for | run SCENARIO=demo */
#define LIMITS_MISSING_MOST_Q13 64  /* [Q13 A] missing q current that counts at most | run SCENARIO=demo */
#define LIMITS_GROWS_SHIFT 3        /* [shift] d current grows by 1/8 of the largest current in 16 periods, while the q current makes room | soak */
#define LIMITS_SLACK_SHIFT 4        /* [shift] q current may be beyond its reference by 1/16 before its limit falls | soak */
#define LIMITS_OVER_STAYS_Q16 57344u /* [Q16] of what was beyond 7/8 still count after 16 periods | soak */
#define FLUX_BRAKE_STEP_Q13 32     /* [Q13 A] a step of the d current that burns: MAXIMUM_CURRENT_A takes a twentieth of a second | run SCENARIO=stop_from_top */
#define FLUX_BRAKE_DEAD_SHARE 0.5         /* [1] of dead time's voltage, which R at full current must exceed for d current to burn anything | catch */
#define ASKED_LESS_SHIFT 5          /* [shift] of MAXIMUM_CURRENT_A 1/32 is left to what the current controllers overshoot | run SCENARIO=demo */
#define SUPPLY_FOLLOWS_Q15 8192     /* [Q15] of its change that the q current for SUPPLY_CURRENT_LIMIT_A takes a step: a quarter | run SCENARIO=rated */
#define DERATE_LEAST 5              /* [1] MAXIMUM_CURRENT_A over what DERATE_BELOW_V leaves of the driving current at UNDER_VOLTAGE_V | run SCENARIO=fault_undervoltage */
#define BRAKE_BAND_V 2.0            /* [V] above REGEN_LIMIT_V, over which braking current falls to nothing | run SCENARIO=brake_without_sink */
#define CHOPPER_BAND_SHARE 0.02     /* [1] of BRAKE_CHOPPER_V, by which the bus falls before the brake resistor is switched off; 2 in messages | run SCENARIO=brake_chopper */
#define CHOPPER_REST_SHIFT 3        /* [shift] a brake resistor that has had its share rests until an eighth of it is given back | run SCENARIO=brake_chopper */
#define SALIENCE_LEAST_SHIFT 2      /* [shift] MTPA's d current follows in four steps of 16 periods | run MOTOR=ipm_4pp_24v_2000 */
#define PARAM_SALIENT_FROM 8.0      /* [1] times the largest current: with more to double the flux MTPA would save less than 0.8 % of it; the tuner reads it | run MOTOR=ipm_4pp_24v_2000 */

/* ---- Load observer ---- */
#define PARAM_QUIET_RATIO 1.22      /* [1] rate without load over SPEED_BANDWIDTH_HZ | loadsteps */
#define PARAM_LOADED_SHARE 0.3      /* [1] rate under load over LOAD_BANDWIDTH_HZ | loadsteps */
#define PARAM_FULL_RATIO 2.7        /* [1] LOAD_BANDWIDTH_HZ over the electrical frequency from which rates and gain are in full | lowspeed */
#define PARAM_LOAD_FROM_LOST 5      /* [1] times the current that dead time loses: the load that begins to count | loadsteps */
#define GATE_SHARE 0.13            /* [1] of dead time's voltage, as a speed: a large innovation without load; twice it is a wrong signal's | loadsteps */
#define GATE_LOADED_SHARE 0.03     /* [1] and under load | loadsteps */
#define OBSERVER_GATE_SPEED_SHIFT 5 /* [shift] and 1/32 of the speed more | loadsteps */
#define OBSERVER_FAST_HALF_Q15 12288     /* [Q15] so quick up to one and a half of what is large: dead time may be behind it | loadsteps */
#define OBSERVER_FAST_FADE_SHIFT 6       /* [shift] after a large innovation the quick rate fades by 1/64 a step | loadsteps */
#define OBSERVER_GATE_OPEN_SHIFT 12   /* [shift] the quick rate above 2^-3 of its most is still an answer: 50 ms or so | loadsteps */
#define OBSERVER_GATE_SHIFT 8     /* [shift] after 256 / 4 steps that were not calm, a large innovation is twice as large | loadsteps */
#define OBSERVER_GATE_STEPS 1000  /* [steps] a load step is over in a tenth of a second; what goes on longer is the loop's own | loadsteps */
#define OBSERVER_GATE_AT_START 768   /* [steps] at the hand-over it is four times as large: d current and wrong constants shake the estimate | starts */

/* ---- TORQUE_PROFILE ---- */
#define PROFILE_RATE 40.0           /* [1/s] twice the rate at which a harmonic is learned where the header has the inertia; less with more of it | run SCENARIO=pulse_learned */
#define PROFILE_CORNER_RATIO 4.2    /* [1] over SPEED_BANDWIDTH_HZ: where shaft and loop lag by a quarter of a turn | run SCENARIO=pulse_learned */
#define PROFILE_DELAY_QUARTERS 15u  /* [1/4 step] and the delay of estimator, observer and current: 1.5 ms at 20 kHz | run SCENARIO=pulse_learned */
#define PROFILE_UNREST_STEPS 700    /* [steps] the gate has been open for so long, four a step: no load step | loadsteps */
#define PROFILE_ERROR_SHARE 0.125   /* [1] of the largest current: the controller's answer counts up to here, so that a load step teaches little | run SCENARIO=pulse_learned */
#define PROFILE_MOST_SHARE 0.5      /* [1] of the largest current: most of a cosine or sine | run SCENARIO=pulse_learned */
#define PROFILE_SUM_SHARE 0.5       /* [1] and of all of them together | run SCENARIO=pulse_learned */
#define PROFILE_LEAST_SHARE 0.15    /* [1] of the nominal speed: below nothing is learned | run SCENARIO=pulse_learned */
#define PROFILE_LEAK_SHIFT 14       /* [shift] of each of its steps: what does not help is forgotten in 13 s | run SCENARIO=pulse_learned */
#define PROFILE_LIMITED_SHIFT 4     /* [shift] a turn that met a limit of voltage or current takes back 1/16 | run SCENARIO=pulse_learned */
#define PROFILE_MISSING_SHIFT 5     /* [shift] voltage is short where 1/32 of the largest current is missing | run SCENARIO=pulse_learned */
#define PROFILE_FADE_SHIFT 9        /* [shift] and in 0.2 s where nothing is learned | run SCENARIO=pulse_learned */

/* ---- Start, hand-over, catch ---- */
#define BOOTSTRAP_SEC 0.010         /* [s] low sides on before the start, for the drivers' supply | starts */
#define PARAM_ALIGN_TURNS 5         /* [turns] of the vector while the current of ALIGN grows; the tuner reads it | starts */
#define ALIGN_EMF_MOST 0.4          /* [1] of R times the start's current: with more back-EMF ALIGN would measure R by a fifth too low, and does not | starts */
#define ALIGN_RISE_LEAST 64         /* [Q14 V] what R takes more of voltage from turn to turn: with less, rounding would be a percent and a half of it | starts */
#define START_LESS_SHIFT 4          /* [shift] until the d current of the hand-over has gone the estimator has 1/16 less R: too much loses a loaded rotor, too little does not | starts */
#define PARAM_EARLY_HZ 20           /* [Hz] electrical frequency from which the load observer is quick enough to catch the rotor | starts */
#define PARAM_EARLY_SHARE 1.25      /* [1] of the minimum speed, at least | starts */
#define AGREE_SEC 0.02              /* [s] the estimator agrees for so long before the hand-over | starts */
#define WAIT_SEC 0.2                /* [s] for the agreement at the end of the ramp | starts */
#define HANDOVER_HURRY 3            /* [1] times the ramp's rate, once the estimator should have agreed | starts */
#define HANDOVER_FALL_SHIFT 7       /* [shift] the current that has brought the rotor up falls by 1/128 + 1/256 a step | starts */
#define HANDOVER_FLOOR_SHIFT 3      /* [shift] to an eighth at least | starts */
#define HANDOVER_SWUNG_SHIFT 5      /* [shift] where the rotor is no longer slower than by 1/32 | starts */
#define HANDOVER_MEAN_SHIFT 5       /* [shift] the speed's mean deviation is one over 32 steps: a rotor swings about the forced speed, a wrong constant is off it | starts */
#define HANDOVER_DECAY 16           /* [2^-16 turn] of the angle's offset that go every 16 periods | starts */
#define HANDOVER_MOST_OFFSET 8192   /* [2^-16 turn] 45 degrees: so much torque of the current is no surprise to the estimator's frame | starts */
#define CATCH_LOOK_STEPS 4u         /* [8 periods] of a look at a slow rotor | catch */
#define CATCH_STANDS 8u             /* [Q11 A] mean of a look's currents below which the rotor stands: two steps of the converter | catch */
#define CATCH_PAUSE_TURN 13653u     /* [2^-16 turn] 75 degrees: less than half a turn, even where a look and a wrong Kphi make them twice as many | catch */
#define CATCH_LEAST_TURN 1638       /* [2^-16 turn] 9 degrees: below a rotor stands | catch */
#define CATCH_PAUSE_LEAST 4u        /* [periods] the look's current goes first | catch */
#define CATCH_PAUSE_STEPS 125u      /* [8 periods] 50 ms: in them a rotor turns a tenth of a right angle, or it stands | catch */
#define CATCH_BUS_SHIFT 5           /* [shift] a start waits for a bus 1/32 below its trip | catch */
#define CATCH_FALL_SHIFT 7          /* [shift] which must fall by 1/128 in some tenths of a second, or it is the supply that holds it | catch */

/* ---- Held shaft ---- */
#define HELD_DOUBTS_MOST 5u   /* [1] steps of 16 periods, below half the reference, that look like a held rotor: then the angle stands | loadsteps */
#define HELD_DOUBTS_FAR 3u    /* [1] below an eighth of the reference a step counts as many | held */
#define HELD_DOUBTS_SWINGS 40u /* [1] and where the speed swings, for then it is so slow in each turn | pulse */
#define HELD_SWINGS 2u        /* [1] swings to one side or the other in a row that are still none: a shaft that is held at an even speed makes one | pulse */
#define HELD_LAG_SHIFT 2      /* [shift] of what the back-EMF's filter is behind 1/4 is forgotten a step, before a rotor is doubted | held */
#define HELD_FAR_LEAD 5461    /* [2^-16 turn] 30 degrees: a frame that is turned back by more changes the currents | held */
#define HELD_FAR_SHIFT 3         /* [shift] and 1/8 of the largest current as d current, which goes as the angle stops | soak */
#define HELD_CLEAR_ANGLE 1024 /* [2^-16 turn] 5.6 degrees: so far from a phase's zero crossing the angle stands | held */
#define HELD_PATIENCE_STEPS 4u /* [steps] of 16 periods for a back-EMF to stand, and twice as many for the currents | loadsteps */
#define HELD_SETTLE_STEPS 2u /* [steps] of 16 periods at least: what the frame's turn shakes may stand still by chance in the first | soak */
#define HELD_TURNED_RAD 0.175 /* [rad] ten degrees, electrical, by what its back-EMF gained: so far no shaft that is held goes | loadsteps */
#define HELD_PULL_ANGLE 182   /* [2^-16 turn] a degree a step, by which all of the current pulls a rotor that stands | loadsteps */
#define HELD_PULL_STEPS 32u   /* [steps] 32 degrees, and back: a load may have stopped it so far ahead of the frame, or behind | loadsteps */
#define HELD_REST_STEPS 2u    /* [steps] of 16 periods that a frame that was turned back takes to settle | loadsteps */
#define HELD_ASK_STEPS 4u     /* [steps] of 16 periods in which a rotor's back-EMF would turn | held */
#define HELD_MEAN_SHIFT 3      /* [shift] a long question compares with the mean of its first 2 HELD_ASK_STEPS | soak */
#define HELD_ASK_MOST_STEPS 32u /* [steps] of 16 periods, for a back-EMF too small to tell sooner | lowspeed */
#define HELD_SLOW_STEPS 64u    /* [steps] of 16 periods, in which the heaviest rotor that was let go is faster than what follows | held */
#define HELD_R_SHIFT 5         /* [shift] after them: R that was learnt at standstill may be off by 1/32 | held */
#define HELD_AGAIN_STEPS 10u  /* [steps] of 16 periods before a rotor that turns is asked again | pulse */

/* ---- Protection ---- */
#define PARAM_R_LEAST 0.7           /* [1] true R over the header's, as make robust promises | robust */
#define PARAM_R_MOST 1.5            /* [1] upwards | robust */
#define PARAM_L_OFF 0.3             /* [1] L off the header's, to either side | robust */
#define PARAM_FLUX_MOST 1.25        /* [1] true flux over the header's: 1.2, and what dead time leaves | robust */
#define ID_OFF_NOISE 0.03125        /* [1] of the largest current: noise in the d current's mean deviation | campaign */
#define ID_OFF_DEAD 0.2             /* [1] of dead time's voltage, which drives the d current against its controller | campaign */
#define ID_OFF_RIPPLE 0.65          /* [1] or of the half ripple, up to which a compensation drives a current that loses nothing | anymotor */
#define OVERSPEED_SHARE 1.25        /* [1] of the maximum speed: the lock is lost above | run SCENARIO=fault_lost_lock */
#define PARAM_STALL_SEC 0.23        /* [s] below half the reference; until a standing rotor shows takes up to 0.08 s more | run SCENARIO=fault_stall_running */
#define STALL_SLOW_SHIFT 1              /* [shift] below half of the reference, or of the minimum speed, a rotor may have stalled | run SCENARIO=fault_stall_running */
#define STALL_FALL 4u               /* [steps] that a fast one takes back | run SCENARIO=fault_stall_running */
#define STALL_ASKS_SHIFT 1              /* [shift] of the largest current: above a quarter of the reference a stalled rotor is asked for more | held MOTOR=ipm_4pp_24v_2000 */
#define LOST_LOCK_SEC 0.06          /* [s] Ed above Eq | run SCENARIO=fault_lost_lock */
#define WRONG_SEC 0.1               /* [s] of innovations that no load explains | run SCENARIO=fault_open_phase */
#define IMPOSSIBLE_SEC 0.25         /* [s] of a flux or resistance that cannot be | campaign */
#define SIGNALS_UNEXPLAINED 2u      /* [steps] so many wrong innovations is an unexplained voltage | run SCENARIO=fault_open_phase */
#define SIGNALS_STANDS_SHIFT 2      /* [shift] below a quarter of the reference an innovation is in time with nothing | pulse */
#define SIGNALS_OPEN_SHIFT 2        /* [shift] an open phase carries less than a quarter of its share, in both rules | run SCENARIO=fault_open_phase */
#define SIGNALS_BLUR_TIMES 4        /* [1] dead time may turn an estimate by a quarter of the back-EMF that it is made from, and more below | run SCENARIO=stop_from_top */
#define PROBE_WAIT_STEPS 13         /* [32 periods] the rotor seems to turn for 20 ms before a probe | run SCENARIO=fault_stall */
#define PROBE_STEPS 25              /* [32 periods] a probe takes 40 ms: more than the estimator's filters at the lowest speed | run SCENARIO=fault_stall */
#define PROBE_DIP_STEPS 6           /* [32 periods] or soon after a speed 10 ms below three quarters of the reference: no ripple lasts so long | run SCENARIO=fault_stall */
#define PROBE_CALM_STEPS 63         /* [steps] of 32 periods, a tenth of a second after a probe: until its own unrest is over | run SCENARIO=fault_stall */
#define PROBE_SOON_STEPS 312        /* [steps] of 32 periods, half a second from one to the next, where something changed fast | run SCENARIO=fault_stall */
#define PROBE_EVERY_STEPS 3125      /* [32 periods] five seconds from one to the next | lowspeed */
#define PROBE_SLOPE_SHIFT 3         /* [shift] the largest current takes 8 steps, so that the estimate does not jump | lowspeed */
#define PROBE_MOST_Q15 22528        /* [Q15] of the largest current, so that as much q current is left | lowspeed */
#define PROBE_LEAST_Q15 14648       /* [Q15] 1/sqrt(5): takes a tenth of the largest q current, and half of a standing rotor's estimate | lowspeed */
#define PROBE_LEAST_SALIENT_Q15 9830 /* [Q15] 0.3: such a d current takes of a salient motor's torque, too | lowspeed MOTOR=ipm_4pp_24v_2000 */
#define SIGNALS_MOST_TIMES 2        /* [1] a deviation counts as twice its limit at most: then it may last 0.35 s | campaign */
#define SIGNALS_MEAN_SHIFT 9        /* [shift] its mean is one over 512 ms | campaign */
#define PROTECTION_BUS_FALL_SHIFT 4 /* [shift] the bus fell where its filter is behind by 1/16: after a fifth at once, for 1.6 ms | campaign */
#define PROTECTION_BUS_STANDS_SHIFT 7 /* [shift] and stands again where it has lost less than 1/128 in 0.2 ms | campaign */
#define SIGNALS_TURNS_MS 256u       /* [ms] from here on a whole turn ends the sum of back-EMF: angles that are wrong at its ends count less and less | campaign */
#define SIGNALS_FLOWS_Q13 96        /* [Q13 A] six steps of the converter: where less flows one of them leaves up to a fifth of dead time's voltage more | campaign */
#define SIGNALS_TURN_ERPM 6000      /* [erpm] faster turns have fewer than ten looks each, and looks that meet the same angles again would sum up; of them a tenth of a second is judged | campaign */
#define SIGNALS_SAMPLES 64u         /* [samples] of the phases' currents that are compared, some 62 ms | run SCENARIO=fault_open_phase */

/* clang-format on */

#endif
