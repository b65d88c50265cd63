# Completion of `stickslip` for bash and zsh; `stickslip completion @SHELL@` prints it.
_stickslip() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
    local command=${COMP_WORDS[1]} name= kind= words= options= positional=
    COMPREPLY=()
    (( COMP_CWORD == 1 )) && command=COMMAND
    case $command in
        COMMAND) options=@COMMANDS@ positional=options ;;
@COMMAND_CASES@
        *) return ;;
    esac
    # bash splits words at "=", zsh does not: NAME=VALUE is completed from `name` and `word`.
    if [[ $word == "=" ]]; then
        name=$before word=
    elif [[ $before == "=" ]]; then
        name=${COMP_WORDS[COMP_CWORD-2]}
    elif [[ $word == *=* ]]; then
        name=${word%%=*} word=${word#*=}
    fi
    if [[ $name == --* ]]; then
        before=$name
    elif [[ -n $name ]]; then
        case $name in
@VALUE_CASES@
        esac
    fi
    if [[ -z $name || $name == --* ]]; then
        case "$command $before" in
@OPTION_CASES@
            *) [[ $word == -* ]] && kind=options || kind=$positional ;;
        esac
    fi
    case $kind in
        options) words=$options ;;
        scenarios) words=@SCENARIOS@ ;;
        parameters) words=@PARAMETERS@ ;;
    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
    if [[ $kind == files || $kind == scenarios ]]; then
        local IFS=$'\n'
        [[ $kind == files ]] && COMPREPLY+=($(compgen -f -- "$word"))
        [[ $kind == scenarios ]] && COMPREPLY+=(
            $(compgen -f -X '!*.y*ml' -- "$word") $(compgen -d -- "$word")
        )
        compopt -o filenames 2>/dev/null
    elif [[ $kind == parameters ]]; then
        compopt -o nospace 2>/dev/null
    fi
    if [[ -n $name && ${COMP_WORDS[COMP_CWORD]} == "$name="* ]]; then
        COMPREPLY=("${COMPREPLY[@]/#/$name=}")
    fi
@SPACE@    return 0
}
complete@NOSPACE@ -F _stickslip stickslip
