"""How fast the simulator is on one core: an integer loop and a DSP loop. What it makes of the firmware, `make pil` prints."""

import time

import asm33
from machine import PROGRAM, Machine

MILLION = 1_000_000
LOOPS = {
    "integer loop": """
        start: mov #0x900,w1
        mov #0x980,w4
        mov #31,w5
        loop: mov [w1++],w2
        mul.ss w2,w2,w6
        asr w6,#3,w6
        add w7,w6,[w4++]
        cp w6,w5
        bra gt,skip
        sub w6,w5,w6
        skip: mov w6,0xA00
        dec w5,w5
        bra nz,loop
        bra start""",
    "DSP loop (MAC with two prefetches)": """
        start: mov #0x900,w8
        mov #0xD00,w10
        clr a,[w8]+=2,w4,[w10]+=2,w5
        do #15,last
        mac w4*w5,a,[w8]+=2,w4,[w10]+=2,w5
        last: mac w4*w5,a,[w8]+=2,w4,[w10]+=2,w5
        sac.r a,w0
        repeat #15
        mac w4*w5,a,[w8]+=2,w4,[w10]+=2,w5
        bra start""",
}

if __name__ == "__main__":
    machine = Machine()
    for name, text in LOOPS.items():
        machine.load(asm33.assemble(text, PROGRAM)[0])
        machine.set_state([0] * 15 + [0x0F00], 0, [0, 0], {0x44: 0x20}, bytes(0x800), PROGRAM)
        begin_s = time.process_time()
        stopped = machine.run(200 * MILLION)
        print(f"{name:<36}{stopped or f'{200 / (time.process_time() - begin_s):.0f} million cycles/s'}")
