/* UART1 on a pseudo-terminal, so that a terminal program can talk to the simulated chip. */
#define _XOPEN_SOURCE 600
#include "sfr.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

struct soc_pty {
    int master, slave; /* the slave is kept open, or reading fails whenever no terminal program is there */
};

static bool make_raw(int file)
{
    struct termios settings;
    if (tcgetattr(file, &settings) != 0) {
        return false;
    }
    settings.c_iflag = 0;
    settings.c_oflag = 0;
    settings.c_lflag = 0;
    settings.c_cflag = CS8 | CREAD | CLOCAL;
    return tcsetattr(file, TCSANOW, &settings) == 0;
}

static bool open_both(soc_pty_t *pty, char *path, size_t size)
{
    pty->master = posix_openpt(O_RDWR | O_NOCTTY);
    if (pty->master < 0 || grantpt(pty->master) != 0 || unlockpt(pty->master) != 0) {
        return false;
    }
    const char *name = ptsname(pty->master);
    if (name == NULL || strlen(name) >= size) {
        return false;
    }
    memcpy(path, name, strlen(name) + 1u);
    pty->slave = open(name, O_RDWR | O_NOCTTY);
    return pty->slave >= 0 && make_raw(pty->slave) && fcntl(pty->master, F_SETFL, O_NONBLOCK) == 0;
}

soc_pty_t *soc_pty_open(char *path, size_t size)
{
    soc_pty_t *pty = malloc(sizeof *pty);
    if (pty == NULL) {
        return NULL;
    }
    *pty = (soc_pty_t){-1, -1};
    if (!open_both(pty, path, size)) {
        soc_pty_close(pty);
        return NULL;
    }
    return pty;
}

void soc_pty_close(soc_pty_t *pty)
{
    if (pty == NULL) {
        return;
    }
    if (pty->slave >= 0) {
        (void)close(pty->slave);
    }
    if (pty->master >= 0) {
        (void)close(pty->master);
    }
    free(pty);
}

/* A terminal that does not read loses characters, as a real one would. */
void soc_pty_send(void *pty, uint8_t character)
{
    ssize_t written = write(((soc_pty_t *)pty)->master, &character, 1);
    (void)written;
}

int soc_pty_receive(void *pty)
{
    uint8_t character = 0;
    return read(((soc_pty_t *)pty)->master, &character, 1) == 1 ? character : -1;
}
