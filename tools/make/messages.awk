# The compiler's messages about userparams.h as lines for a user.
#
#   awk -F '\t' -v header=FILE -v compiler=NAME -v refused=FILE -v near=FILE -v meant=FILE -v as_read=FILE -f messages.awk PLACES NEEDS MESSAGES
#
# PLACES: name, file:line, range of each parameter that the header has; NEEDS: a line for each relation, the names that it is computed from;
# `refused`: what was told so far, to which new names and relations are added; `near`: missing names that were told with a misspelt one;
# `meant`: names and values that the checks take in place of what was refused, so that nothing follows from that;
# `as_read`: what literals.awk made of values that it may refuse.
# Exit code: 0 the header's own checks have told what they found, 3 one parameter is no C and hides the others, 2 the header cannot be read.

function place_of(text,   word, count, words, i) {
    gsub(/[^A-Za-z0-9_]+/, " ", text)
    count = split(text, words, " ")
    for (i = 1; i <= count; i++)
        if (words[i] in place) return place[words[i]]
    return header
}

# The parameters that a text names, between blanks.
function named(text,   count, words, i, found) {
    gsub(/[^A-Za-z0-9_]+/, " ", text)
    count = split(text, words, " ")
    for (i = 1; i <= count; i++)
        if (words[i] in range) found = found " " words[i]
    return found " "
}

# Whether two lists of names have one in common.
function share(one, other,   count, words, i) {
    count = split(one, words, " ")
    for (i = 1; i <= count; i++)
        if (index(other, " " words[i] " ")) return 1
    return 0
}

# A relation "A = 5 must be below B = 3" in its parts: the name and value that must be less, and the other's. Whether it is of this kind.
function ordered(text, part,   word, count, turned) {
    sub(/:.*/, "", text)
    count = split(text, word, " ")
    if (text !~ /^[A-Z0-9_]+ = [-+.0-9eE]+ must (be (above|below|at least|at most)|not exceed) [A-Z0-9_]+ = [-+.0-9eE]+$/) return 0
    turned = text ~ /above|at least/
    part[turned ? "high" : "low"] = word[1]
    part[turned ? "highest" : "lowest"] = word[3] + 0
    part[turned ? "low" : "high"] = word[count - 2]
    part[turned ? "lowest" : "highest"] = word[count] + 0
    return 1
}

# Whether no value of the parameter that two relations share would mend both: A < B and B < C, but A is not below C.
function apart(one, other,   a, b) {
    if (!ordered(one, a) || !ordered(other, b)) return 0
    return a["high"] == b["low"] && a["lowest"] >= b["highest"] || b["high"] == a["low"] && b["lowest"] >= a["highest"]
}

# Whether what a relation says may be the fault of what was told before: a value that it needs, or a relation that one of its own parameters would mend.
function follows(number,   i, list) {
    for (i in told)
        if (!(i in known) && index(needs[number], " " i " ")) return 1
    for (i = 1; i <= relations; i++)
        if ((share(needs[number], names_of[i]) || share(named(relation[number]), needs_of[i])) && !apart(relation[number], text_of[i])) return 1
    return 0
}

# From "A = 5 must not exceed B = 2: why" "must not exceed B = 2", if it names a value to compare with.
function demand(text) {
    sub(/:.*/, "", text)
    return match(text, / must .* = /) ? substr(text, RSTART) : ""
}

# Tells of relations, in their order: each that is a mistake of its own; those that demand the same of several parameters are one line.
function tell_relations(   number, i, same, first, subject, others, more) {
    for (number = 0; number < count_of_needs; number++) {
        if (!(number in relation)) continue
        text = relation[number]
        same = demand(text)
        first = 0
        for (i = 1; same != "" && i <= relations; i++)
            if (demands[i] == same) first = i
        if (first && !(text in told)) {
            subject = text
            sub(/ must .*/, "", subject)
            others[first] = others[first] ";" subject
            print text >>refused
        }
        else if (text in told || !follows(number)) {
            relations++
            text_of[relations] = text
            line_of[relations] = text in told ? "" : text
            names_of[relations] = named(text)
            needs_of[relations] = needs[number]
            demands[relations] = same
            if (!(text in told)) print text >>refused
        }
    }
    for (i = 1; i <= relations; i++)
        if (line_of[i] != "") print "foc33: " place_of(line_of[i]) ": " joined(line_of[i], others[i])
}

# The line of several parameters: the first few by name.
function joined(text, others,   count, subject, i, list) {
    if (others == "") return text
    count = split(substr(others, 2), subject, ";")
    list = text
    sub(/ must .*/, "", list)
    for (i = 1; i <= count && i < MOST; i++) list = list (i == count ? " and " : ", ") subject[i]
    if (count >= MOST) list = list (count == MOST ? " and " subject[MOST] : " and " count - MOST + 1 " more")
    return list demand(text)
}

# What a value of whole numbers is meant to be.
function meaning(text, kind) {
    sub(/ (is|divides) .*/, "", text)
    if (kind == "octal") sub(/0+/, "", text)
    else gsub(/[0-9]+/, "&.0", text)
    return text
}

# The line of the header in which a name stands that the compiler has not seen there; 0 if it stands nowhere.
function unseen(name,   line, number, at) {
    while ((getline line < header) > 0) {
        number++
        if (!at && line ~ "^[ \t]*#[ \t]*define[ \t]+" name "[ \t]") at = number
    }
    close(header)
    return at
}

BEGIN {
    MOST = 5
    LONGEST = 120
    while ((getline line < refused) > 0) told[line] = some = 1
    while ((getline line < near) > 0) told[line] = 1
    close(refused)
    while ((getline line < meant) > 0) known[substr(line, 1, index(line, "\t") - 1)] = 1
    close(meant)
    while ((getline line < as_read) > 0) read_as[substr(line, 1, index(line, "\t") - 1)] = line
}
FILENAME ~ /places$/ { place[$1] = $2; range[$1] = $3; next }
FILENAME ~ /needs$/ { needs[count_of_needs++] = " " $0 " "; next }
match($0, /In function .(range|text|relations)_(of_)?[A-Za-z0-9_]+/) {
    name = substr($0, RSTART, RLENGTH)
    between = name ~ /relations_/
    sub(/.*_of_/, "", name)
}
match($0, /error: userparams\.h: /) {
    text = substr($0, RSTART + RLENGTH)
    if (match(text, / \.\. [-0-9.]+ 1 \(/)) text = substr(text, 1, RSTART + RLENGTH - 5) " (" substr(text, RSTART + RLENGTH) # of no unit
    first = text
    sub(/ .*/, "", first)
    if (match(text, /^[A-Z0-9_]+ = .* must /) && RLENGTH > LONGEST) text = first substr(text, RSTART + RLENGTH - 6) # a value of macros, written out
    checked = 1
    if (between) {
        match($0, /relation_[0-9]+/)
        relation[substr($0, RSTART + 9, RLENGTH - 9) + 0] = text
        next
    }
    if (first in told || first == name && !(first in place) && text !~ / is missing: /) next
    if (text ~ / is missing: / && (at = unseen(name))) {
        lines[++count] = "foc33: " header ":" at ": " name " stands where the compiler does not read: " \
            "close the comment above it with */, or mend the #if around it"
        names[count] = name
        next
    }
    lines[++count] = "foc33: " (first == name && !(first in place) ? header : place_of(text)) ": " text
    if (text ~ / has an octal number, | divides whole numbers, / && name in read_as) print read_as[name] >>meant
    else if (match(text, / = [-+0-9]+ is octal to C/)) print name "\t" meaning(substr(text, RSTART + 3), "octal") >>meant
    else if (match(text, / = [-+0-9\/() ]+ divides whole numbers/)) print name "\t" meaning(substr(text, RSTART + 3), "fraction") >>meant
    names[count] = name
    next
}
/error: / && between && some { # a relation with a value that was told to be no number
    checked = 1
    next
}
/error: / && other == "" {
    other = $0
    other_name = name
}
END {
    if (other != "" && other_name in place && !(other_name in told)) {
        sub(/.*error: /, "", other)
        print "foc33: " place[other_name] ": " other_name " is no number (" other "): write one" (range[other_name] != "" ? ", " range[other_name] : ", or remove the line")
        print other_name >>refused
        exit 3
    }
    if (other != "" || !checked) {
        print "foc33: " (other != "" ? other ": correct it" : "the compiler cannot read " header ", " compiler ": it ended without a message, try it by hand")
        exit 2
    }
    for (i = 1; i <= count; i++) {
        print lines[i]
        print names[i] >>refused
    }
    tell_relations()
}
