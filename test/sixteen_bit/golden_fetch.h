/* Golden vectors in a test image: rows come from the simulator. */
#ifndef TEST_GOLDEN_FETCH_H
#define TEST_GOLDEN_FETCH_H

#include <stdint.h>

/** Copies a row of a table.
 *  @param table its number
 *  @param place of the row's first 16-bit word in the table
 *  @param words of a row */
void golden_fetch(uint16_t table, uint32_t place, void *row, uint16_t words);

#endif
