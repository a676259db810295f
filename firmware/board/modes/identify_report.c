/* IDENTIFY on the board: what has been measured, for the debugger and the UART. */
#include "board/modes/identify_report.h"

#ifdef IDENTIFY

#include "board/text.h"

tIdentifyParm IdentifyParm;

char *identify_status_line(char *line, const drive_t *d)
{
    static const char *const results[] = { IDENTIFY_RESULT_TABLE(IDENTIFY_RESULT_NAME) };
    const identify_t *id = &d->run.identify;
    char *at = text_put(text_put_unsigned(text_put(line, "step "), id->step), " ");
    at = text_put(text_put(at, results[id->result]), " fault ");
    at = text_put(text_put_unsigned(at, d->fault), " R ");
    at = text_put(text_put_unsigned(at, id->values.rs_mohm), " mohm Ld ");
    at = text_put(text_put_unsigned(at, id->values.ld_uh), " uH Lq ");
    at = text_put(text_put_unsigned(at, id->values.lq_uh), " uH Kphi ");
    at = text_put(text_put_unsigned(at, id->values.kphi_mv_per_krpm), " mV/krpm J ");
    at = text_put(text_put_unsigned(at, id->values.inertia_1e8_kgm2), "e-8 kgm2 friction ");
    at = text_put(text_put_unsigned(at, id->values.coulomb_unm), " uNm + ");
    return text_put(text_put_unsigned(at, id->values.viscous_nnms), " nNms\r\n");
}

void identify_watch(const drive_t *d)
{
    const identify_t *id = &d->run.identify;
    IdentifyParm.step = id->step;
    IdentifyParm.result = id->result;
    IdentifyParm.Rs_mohm = id->values.rs_mohm;
    IdentifyParm.Ld_uH = id->values.ld_uh;
    IdentifyParm.Lq_uH = id->values.lq_uh;
    IdentifyParm.Kphi_mV_per_krpm = id->values.kphi_mv_per_krpm;
    IdentifyParm.J_1e8_kgm2 = id->values.inertia_1e8_kgm2;
    IdentifyParm.Coulomb_uNm = id->values.coulomb_unm;
    IdentifyParm.Viscous_nNms = id->values.viscous_nnms;
}

#endif
