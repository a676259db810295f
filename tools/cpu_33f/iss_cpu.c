/* The core as the processor of a chip. */
#include "iss_cpu.h"

/* ---- what the chip asks of it ---- */

static volatile uint16_t *reg(void *context, const char *name)
{
    const iss_cpu_t *cpu = context;
    int address = chip_register(name);
    return address < 0 ? NULL : (volatile uint16_t *)&iss_data(cpu->iss)[address / 2];
}

static uint64_t cycles(void *context)
{
    return iss_cycles(((const iss_cpu_t *)context)->iss);
}

/* The core looks at its flags before the next instruction. */
static bool raised(void *context, unsigned irq)
{
    const iss_cpu_t *cpu = context;
    iss_irq_changed(cpu->iss);
    return (chip_get(cpu->chip, SFR_IEC0 + 2u * (irq / 16u)) >> irq % 16u & 1u) != 0;
}

static void attend(void *context)
{
    const iss_cpu_t *cpu = context;
    if (cpu->running) {
        iss_request_stop(cpu->iss);
    }
}

static bool wake(void *context)
{
    const iss_cpu_t *cpu = context;
    if (iss_power(cpu->iss) == ISS_POWER_RUN) {
        return false;
    }
    iss_wake(cpu->iss);
    return true;
}

static void flash(void *context, bool erases, unsigned words, uint64_t cycles_long)
{
    iss_flash(((const iss_cpu_t *)context)->iss, erases, words, cycles_long);
}

/* ---- accesses of the core ---- */

static uint16_t read_counter(void *context, uint16_t address)
{
    iss_cpu_t *cpu = context;
    if (cpu->counter != NULL) {
        chip_put(cpu->chip, address, cpu->counter(cpu));
    }
    return chip_get(cpu->chip, address);
}

static void write_acting(void *context, uint16_t address, uint16_t value, uint16_t mask)
{
    iss_cpu_t *cpu = context;
    uint16_t now = chip_merged(cpu->chip, address, value, mask);
    bool changed = now != chip_get(cpu->chip, address);
    chip_put(cpu->chip, address, now);
    if (cpu->written != NULL && (changed || address == SFR_P1DC3)) {
        cpu->written(cpu, address);
    }
}

static void reset_by_core(void *context, chip_reset_t cause)
{
    chip_request_reset(((const iss_cpu_t *)context)->chip, cause);
}

void iss_cpu_connect(iss_cpu_t *cpu, chip_t *chip, const iss_image_t *image)
{
    static const uint16_t acting[] = {SFR_P1TCON, SFR_PWM1CON1, SFR_PWM1CON2, SFR_P1FLTACON, SFR_P1OVDCON, SFR_P1DC1, SFR_P1DC2, SFR_P1DC3};
    cpu->chip = chip;
    for (unsigned n = 0; n < CHIP_WORDS; n++) {
        if (chip->hook[n].read != NULL || chip->hook[n].write != NULL) {
            iss_sfr_hook(cpu->iss, (uint16_t)(2u * n), chip->hook[n].read, chip->hook[n].write, chip);
        }
    }
    for (size_t n = 0; n < sizeof acting / sizeof acting[0]; n++) {
        iss_sfr_hook(cpu->iss, acting[n], NULL, write_acting, cpu);
    }
    iss_sfr_hook(cpu->iss, SFR_P1TMR, read_counter, NULL, cpu);
    iss_on_clrwdt(cpu->iss, chip_watchdog_clear, chip);
    iss_on_reset(cpu->iss, reset_by_core, cpu);
    for (unsigned n = 0; n < CHIP_CONFIG_WORDS; n++) {
        chip->config[n] = image->config[n];
    }
    iss_cpu_reset(cpu, CHIP_RESET_POR);
}

/* ---- running ---- */

void iss_cpu_reset(iss_cpu_t *cpu, chip_reset_t cause)
{
    iss_reset(cpu->iss, cause);
    chip_reset(cpu->chip, cause);
    iss_irq_changed(cpu->iss);
}

void iss_cpu_break(iss_cpu_t *cpu)
{
    cpu->broken = true;
    iss_request_stop(cpu->iss);
}

/* A reset that an instruction or a peripheral has asked for. */
static void finish_reset(iss_cpu_t *cpu)
{
    cpu->chip->resets++;
    iss_cpu_reset(cpu, cpu->chip->pending_cause);
    if (cpu->was_reset != NULL) {
        cpu->was_reset(cpu);
    }
    cpu->broken = true;
}

iss_stop_t iss_cpu_run(iss_cpu_t *cpu, uint64_t until_cycle)
{
    chip_t *chip = cpu->chip;
    iss_stop_t stop = ISS_STOP_NONE;
    cpu->running = true;
    cpu->broken = false;
    while (iss_cycles(cpu->iss) < until_cycle && !cpu->broken && stop == ISS_STOP_NONE) {
        uint64_t next = chip_next_event(chip);
        chip->limit = next < until_cycle ? next : until_cycle;
        stop = iss_run(cpu->iss, chip->limit);
        if (stop == ISS_STOP_REQUEST) {
            stop = ISS_STOP_NONE;
        }
        chip_happen(chip);
        if (chip->pending_reset) {
            finish_reset(cpu);
        }
    }
    cpu->running = false;
    return stop == ISS_STOP_NONE && cpu->broken ? ISS_STOP_REQUEST : stop;
}

/* ---- creation ---- */

bool iss_cpu_create(iss_cpu_t *cpu, const iss_image_t *image, chip_cpu_t *functions)
{
    *cpu = (iss_cpu_t){.iss = iss_create()};
    if (cpu->iss == NULL) {
        return false;
    }
    for (uint32_t n = 0; n < ISS_PROGRAM_WORDS; n++) {
        iss_program(cpu->iss)[n] = image->program[n];
    }
    iss_program_changed(cpu->iss);
    functions->context = cpu;
    functions->reg = reg;
    functions->cycles = cycles;
    functions->raised = raised;
    functions->attend = attend;
    functions->wake = wake;
    functions->flash = flash;
    return true;
}

void iss_cpu_destroy(iss_cpu_t *cpu)
{
    iss_destroy(cpu->iss);
    cpu->iss = NULL;
}
