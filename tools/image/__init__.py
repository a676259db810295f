"""The image for the dsPIC33FJ32MC204: reading it, checking it, programming it, and the MPLAB X project."""
