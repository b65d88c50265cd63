
_stickslip_parameters() { compgen -W '@PARAMETERS@' -- "$1"; }
_stickslip_words_or_files() {
    compgen -W "$2" -- "$1"
    compgen -f -X "!$3" -- "$1"
    compgen -d -- "$1"
}
_stickslip_scenario_files() { _stickslip_words_or_files "$1" '@SCENARIOS@' '*.y*ml'; }
_stickslip_controller_files() { _stickslip_words_or_files "$1" '@LAWS@' '*.py'; }
# bash splits words at "=": NAME=VALUE is completed as one word, --OPTION=VALUE as two.
_stickslip() {
    local words=("") word
    for word in "${COMP_WORDS[@]:0:COMP_CWORD+1}"; do
        case ${words[-1]},$word in
            --*,=) words+=("") ;;
            *,= | *=,* | ,*) words[-1]+=$word ;;
            *) words+=("$word") ;;
        esac
    done
    local COMP_WORDS=("${words[@]}") COMP_CWORD=$((${#words[@]} - 1))
    _shtab_stickslip
    [[ ${COMPREPLY[0]-} == *= ]] && compopt -o nospace
    [[ ${words[-1]} == *=* ]] && COMPREPLY=("${COMPREPLY[@]#*=}")
    return 0
}
