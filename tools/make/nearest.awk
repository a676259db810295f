# The name of `names`, with blanks between them, that is most like the word, whatever the case; "" for none as like as `least`, 0 .. 1.
# Without python3 there is none.
function nearest(word, names, least,   command, found) {
    command = "python3 -c 'import difflib, sys; word, least, *names = sys.argv[1:]; known = {name.upper(): name for name in sorted(names, reverse=True)}; " \
        "print(*map(known.get, difflib.get_close_matches(word.upper(), known, 1, float(least))))' " word " " least " " names " 2>/dev/null"
    if (word ~ /^[A-Za-z0-9_]+$/) command | getline found
    close(command)
    return found
}
